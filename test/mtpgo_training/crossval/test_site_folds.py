# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Sites by directory, location and configuration, and the training data without one of them."""

import dataclasses

import pytest
from tiny_run import CONFIG
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.crossval.site_folds import FoldSite, chosen_sites, find_sites, without_site
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.splits import NamedRecording


def named(source, name, location="1"):
    recording = dataclasses.replace(braking_cars(name, tracks=2, seconds=2.0), location=location)
    return NamedRecording(source, recording)


RECORDINGS = [
    named("ngsim", "01", "1"),
    named("ngsim", "02", "2"),
    named("ngsim", "03", "1"),
    named("i80", "01", "10"),
    named("lyon", "01"),
    named("lyon", "02"),
]


def as_dict(sites):
    return {site.name: site.recordings for site in sites}


def configured(**data):
    return dataclasses.replace(CONFIG, data=DataConfig(**data))


def test_a_directory_is_a_site_and_so_is_each_of_its_locations():
    assert as_dict(find_sites(RECORDINGS, {})) == {
        "ngsim-1": ("ngsim/01", "ngsim/03"),
        "ngsim-2": ("ngsim/02",),
        "i80": ("i80/01",),
        "lyon": ("lyon/01", "lyon/02"),
    }


def test_the_configuration_names_and_merges_sites():
    sites = find_sites(
        RECORDINGS, {"us101": ["ngsim-1"], "others": ["i80", "lyon/02"], "rest": ["lyon/01"]}
    )
    assert as_dict(sites) == {
        "us101": ("ngsim/01", "ngsim/03"),
        "others": ("i80/01", "lyon/02"),
        "rest": ("lyon/01",),
        "ngsim-2": ("ngsim/02",),
    }


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"a": ["us101"]}, "crossval.sites.a names 'us101', expected a directory"),
        ({"a": ["i80"], "b": ["i80/01"]}, "i80/01 is in crossval.sites.a and in crossval.sites.b"),
    ],
)
def test_a_site_that_cannot_be_is_an_error(given, sentence):
    with pytest.raises(ConfigurationError, match=sentence):
        find_sites(RECORDINGS, given)


def test_sites_are_chosen_by_name():
    sites = find_sites(RECORDINGS, {})
    assert [site.name for site in chosen_sites(sites, None)] == [s.name for s in sites]
    assert [site.name for site in chosen_sites(sites, ["lyon", "i80"])] == ["lyon", "i80"]
    with pytest.raises(ConfigurationError, match="--sites names 'i81', expected 'ngsim-1', "):
        chosen_sites(sites, ["i81"])
    with pytest.raises(ConfigurationError, match=r"of one site \(i80\), expected at least two"):
        chosen_sites(sites[2:3], None)


def test_the_other_sites_keep_their_uses_without_the_tests():
    config = configured(validation=("ngsim/03", "lyon/01"), test=("i80/01",))
    site = FoldSite("ngsim-1", ("ngsim/01", "ngsim/03"))
    fold, others = without_site(config, RECORDINGS, site)
    assert [item.name for item in others] == ["ngsim/02", "lyon/01", "lyon/02"]
    assert fold.data.validation == ("lyon/01",)
    assert (fold.data.train, fold.data.test) == ((), ())


def test_only_the_configured_recordings_are_trained_on():
    config = configured(train=("ngsim/02", "lyon/02"), validation=("lyon/01",), test_fraction=0.3)
    _, others = without_site(config, RECORDINGS, FoldSite("i80", ("i80/01",)))
    assert [item.name for item in others] == ["ngsim/02", "lyon/01", "lyon/02"]


def test_validation_is_drawn_where_the_site_took_it_all():
    config = configured(validation=("i80/01",), validation_fraction=0.2)
    fold, others = without_site(config, RECORDINGS, FoldSite("i80", ("i80/01",)))
    assert fold.data.validation == ()
    assert fold.data.validation_fraction == 0.2
    assert len(others) == 5


def test_weights_of_the_left_out_site_are_dropped():
    weights = {"i80": 0.5, "i80/01": 0.1, "lyon": 0.3, "lyon/02": 2.0}
    config = configured(validation=("lyon/01",), source_weight=weights)
    fold, _ = without_site(config, RECORDINGS, FoldSite("i80", ("i80/01",)))
    assert fold.data.source_weight == {"lyon": 0.3, "lyon/02": 2.0}


def test_with_blocks_of_time_all_other_recordings_are_used():
    config = configured(split="time", validation_fraction=0.2)
    fold, others = without_site(config, RECORDINGS, FoldSite("lyon", ("lyon/01", "lyon/02")))
    assert [item.name for item in others] == ["ngsim/01", "ngsim/02", "ngsim/03", "i80/01"]
    assert fold.data == config.data


def test_nothing_left_to_train_on_is_an_error():
    config = configured(train=("i80/01",), validation=("lyon/01",))
    with pytest.raises(ConfigurationError, match=r"no recording is left in data\.train without"):
        without_site(config, RECORDINGS, FoldSite("i80", ("i80/01",)))
