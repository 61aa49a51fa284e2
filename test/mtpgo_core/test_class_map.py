# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Class maps: presets, files, how names are compared, and what is refused."""

import unicodedata

import numpy as np
import pytest

from mtpgo_core.class_map import OWN_NAMES, PRESETS, class_map, read_class_map
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.schema import AgentClass

CAR, TRUCK, BUS, UNKNOWN = AgentClass.CAR, AgentClass.TRUCK, AgentClass.BUS, AgentClass.UNKNOWN
PEDESTRIAN, VAN = AgentClass.PEDESTRIAN, AgentClass.VAN


@pytest.mark.parametrize(
    ("preset", "name", "expected"),
    [
        ("nuscenes", "vehicle.car", CAR),
        ("nuscenes", "Vehicle.Car ", CAR),
        ("nuscenes", "vehicle.bus.rigid", BUS),
        ("nuscenes", "human.pedestrian.adult", PEDESTRIAN),
        ("nuscenes", "construction vehicle", TRUCK),
        ("nuscenes", "movable_object.trafficcone", UNKNOWN),
        ("nuscenes", "car", CAR),  # as without a map
        ("nuscenes", "9", VAN),  # the map has no numbers, so ours hold
        ("coco", "2", CAR),
        ("coco", "0", PEDESTRIAN),
        ("coco", "7", TRUCK),
        ("coco", "16", AgentClass.ANIMAL),  # dog
        ("coco", "9", UNKNOWN),  # a traffic light, not our van
        ("coco", "person", PEDESTRIAN),
        ("coco91", "3", CAR),
        ("coco91", "8", TRUCK),
        ("coco91", "18", AgentClass.ANIMAL),  # dog
        ("autoware", "1", CAR),
        ("autoware", "9", UNKNOWN),
        ("autoware", "MOTORBIKE", AgentClass.MOTORCYCLE),
        ("waymo", "TYPE_CYCLIST", AgentClass.BICYCLE),
        ("argoverse2", "vehicle", CAR),
    ],
)
def test_presets(preset, name, expected):
    assert class_map(preset).find(name) == expected


def test_every_preset_names_classes_of_ours():
    for names in PRESETS.values():
        assert {value.upper() for value in names.values()} <= set(AgentClass.__members__)


def test_names_that_mean_nothing():
    names = ["tram", "car", "", "unknown", "movable_object.barrier", "77", "3"]
    assert class_map("nuscenes").not_known(names) == ["77", "tram"]
    assert class_map("coco").not_known(["3", "9", "200"]) == ["200"]


def test_own_words_and_numbers_build_on_a_preset(tmp_path):
    path = tmp_path / "classes.yaml"
    path.write_text(
        "preset: nuscenes\nTram: bus\nfork-lift: Truck\n17: pedestrian\nno: animal\n"
        "vehicle.car: van\n'traffic cone': unknown\n"
    )
    names = ["tram", "Fork Lift", "17", "no", "vehicle.car", "vehicle.truck", "traffic_cone", "3"]
    found = class_map(path).find_all(names)
    assert found.dtype == np.uint8
    assert found.tolist() == [BUS, TRUCK, PEDESTRIAN, AgentClass.ANIMAL, VAN, TRUCK, 0, 0]
    assert class_map(path).find("nothing", "tram") == BUS


def test_without_a_map_our_own_names_and_numbers_hold():
    assert class_map("") is OWN_NAMES
    assert OWN_NAMES.find_all(["1.0", "3.00", 1.0, "1.5"]).tolist() == [CAR, BUS, CAR, 0]
    names = ["car", "Truck_Bus", "3", "10", "vehicle.car", "", "\N{SUPERSCRIPT TWO}", "9" * 5000]
    assert OWN_NAMES.find_all(names).tolist() == [CAR, TRUCK, BUS, 0, 0, 0, 0, 0]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "car: car\ntram: trolley\n",
            "line 2: the class 'trolley' of 'tram' is unknown, expected",
        ),
        ("car: van\nCar: truck\n", "line 2: 'Car' is given a second class, 'truck' after 'van'"),
        ("preset: coco\npreset: waymo\n", "line 2: a second preset 'waymo', expected one"),
        ("preset: kitti\n", "line 1: the preset 'kitti' is unknown, expected one of 'nuscenes'"),
        ("- car\n", "is no mapping, expected lines such as 'vehicle.car: car'"),
        ("", "is no mapping"),
        ("car: [1, 2]\n", "line 1: a list or a mapping, expected a name or number and a class"),
        ("car: {a: b\n", "cannot be read as YAML: "),
        ("\ta: b\n", "line 1 cannot be read as YAML: "),
        ("[" * 5000, "cannot be read as YAML"),
        ("\x00", "cannot be read as YAML"),
    ],
)
def test_a_bad_file_is_one_sentence_with_its_line(tmp_path, text, sentence):
    path = tmp_path / "classes.yaml"
    path.write_text(text)
    with pytest.raises(ConfigurationError) as caught:
        read_class_map(path)
    assert str(caught.value).startswith(str(path))
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_no_file_or_too_large_is_refused(tmp_path):
    with pytest.raises(ConfigurationError, match="'kitti' is neither a preset nor a file"):
        class_map("kitti")
    path = tmp_path / "large.yaml"
    path.write_text("a: car\n" * 50_000)
    with pytest.raises(ConfigurationError, match="is larger than 65536 bytes"):
        class_map(path)
    (tmp_path / "latin.yaml").write_bytes(b"\xfcber: car\n")
    with pytest.raises(ConfigurationError, match="cannot be read as YAML"):
        class_map(tmp_path / "latin.yaml")


def test_a_name_longer_than_any_is_none():
    """Its beginnings would be looked up one by one: a message is not to keep the node busy."""
    assert class_map("nuscenes").find("vehicle.bus" + ".x" * 50) == BUS
    assert class_map("nuscenes").find("vehicle.bus" + ".x" * 100) == UNKNOWN
    assert OWN_NAMES.find("." * 1_000_000) == UNKNOWN


def test_umlauts_of_one_character_and_of_two_are_the_same(tmp_path):
    names = [unicodedata.normalize(form, "Fußgänger") for form in ("NFC", "NFD")]
    assert names[0] != names[1]
    for name in names:
        path = tmp_path / "map.yaml"
        path.write_text(f"{name}: pedestrian\n")
        classes = read_class_map(path)
        assert classes.find_all(names).tolist() == [PEDESTRIAN, PEDESTRIAN]
        assert classes.not_known(names) == []
