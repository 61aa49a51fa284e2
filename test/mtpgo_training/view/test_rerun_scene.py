# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The file of rerun, read back by rerun."""

import dataclasses
import re
import resource
import subprocess
import sys

import numpy as np
import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.schema import AgentClass
from mtpgo_training.reports.drawn_bodies import CLASS_COLOURS
from mtpgo_training.view.view_colours import GROUND, colour_bytes

rerun = pytest.importorskip("rerun", reason="the extra view (rerun-sdk) is not installed")


def told_of(path, *options):
    """Return what rerun tells about a file."""
    command = [sys.executable, "-m", "rerun", "rrd", "print", *options, str(path)]
    read = subprocess.run(command, capture_output=True, text=True, check=True)
    return read.stdout + read.stderr


def rows_of(path, entity, part=""):
    """Return how many rows of an entity there are."""
    found = re.findall(rf"with (\d+) rows .* - {re.escape(entity)} .*{part}", told_of(path, "-v"))
    return sum(map(int, found))


@pytest.fixture(scope="module")
def file(scene, tmp_path_factory):
    from mtpgo_training.view.rerun_scene import log_scene

    path = tmp_path_factory.mktemp("rerun") / "a.rrd"
    log_scene(scene, path)
    return path


def test_the_file_has_road_users_modes_ellipses_truth_and_errors(file):
    told = told_of(file, "-v")
    for part in (
        "/scene/road_users/car",
        "/scene/road_users/truck",
        "/scene/past",
        "/scene/lanes",
        "/scene/predictions/modes",
        "/scene/predictions/ellipses",
        "/scene/what_happened",
        "/errors/ade",
        "/errors/final",
        "/legend",
    ):
        assert f" {part} " in told, part


def test_a_less_likely_mode_is_lighter_though_rerun_draws_no_transparent_lines(file):
    told = told_of(file, "-vvv", "--entity", "/scene/predictions/modes")
    ground = np.array(colour_bytes(GROUND))
    for kind in (AgentClass.CAR, AgentClass.TRUCK):
        own = np.array(colour_bytes(CLASS_COLOURS[kind]))
        for weight in (1.0, 0.25 / 0.75):
            red, green, blue = np.rint(ground + (0.2 + 0.8 * weight) * (own - ground)).astype(int)
            assert f"{red << 24 | green << 16 | blue << 8 | 255}" in told, (kind, weight)


def test_errors_are_shown_that_were_known_before_the_end(file):
    # 12 s with a horizon of 5 s, a prediction every 0.2 s.
    assert rows_of(file, "/errors/ade", "Scalars") == 36
    assert rows_of(file, "/errors/final", "Scalars") == 36


def curve_of(path, entity):
    """Return times (s) and rows of a curve, as text, in the order of the file."""
    told = told_of(path, "-vvv", "--entity", entity)
    return re.findall(r"┆ PT([\d.]+)S +┆ (\[.*?\]) +│", told)


def test_the_curves_do_not_lead_over_a_time_without_predictions(scene, file, tmp_path):
    from mtpgo_training.view.rerun_scene import log_scene

    def kept(seen):
        time_s = scene.since_start_s(seen.prediction.stamp_ns)
        return time_s < 1.1 or time_s > 3.9 or abs(time_s - 2.0) < 0.01

    some = tuple(seen for seen in scene.predictions if kept(seen))
    log_scene(dataclasses.replace(scene, predictions=some), tmp_path / "b.rrd")
    for entity in ("/errors/ade", "/errors/final"):
        times, values = zip(*curve_of(tmp_path / "b.rrd", entity), strict=True)
        # An empty row ends a line of rerun. 1.0 s are no longer than a prediction is shown.
        assert [float(t) for t, v in zip(times, values, strict=True) if v == "[]"] == [8.0]
        assert list(map(float, times)) == sorted(map(float, times))
        assert len(values) == 6 + 1 + 1 + 16
        assert "[]" not in dict(curve_of(file, entity)).values()


def test_a_prediction_is_shown_for_no_longer_than_a_second(scene, file, tmp_path):
    from mtpgo_training.view.rerun_scene import log_scene

    # The last one is of 10.0 s, the recording ends at 12.0 s.
    assert rows_of(file, "/scene/predictions", "Clear") == 1
    assert rows_of(file, "/scene/what_happened", "Clear") == 1
    log_scene(dataclasses.replace(scene, predictions=()), tmp_path / "b.rrd")
    assert rows_of(tmp_path / "b.rrd", "/scene/predictions", "Clear") == 0


@pytest.mark.parametrize("step_m", [0.0, 0.05, 0.3, 2.0])
def test_what_happened_is_dashed_at_every_speed(step_m):
    from mtpgo_training.view.rerun_scene import DASH_M, _dashes

    way = np.stack([step_m * np.arange(60), np.zeros(60), np.zeros(60)], axis=-1)
    dashes = _dashes(way)
    assert all(len(dash) > 1 for dash in dashes)
    lengths = [dash[-1, 0] - dash[0, 0] for dash in dashes]
    if step_m:
        assert len(dashes) > 1
        np.testing.assert_allclose(lengths[:-1], max(DASH_M, step_m), atol=step_m)
        assert sum(lengths) == pytest.approx(59 * step_m / 2, abs=DASH_M)


def test_every_class_has_the_name_of_its_colour():
    from mtpgo_training.view.rerun_blueprint import COLOUR_NAMES, legend

    assert set(COLOUR_NAMES) == set(AgentClass)
    assert len(set(COLOUR_NAMES.values())) == len(AgentClass)
    text = str(legend([AgentClass.TRUCK, AgentClass.CAR], True).text.as_arrow_array()[0])
    assert text.startswith("- **blue**: car\n- **orange**: truck\n")
    assert "90 % of the truth after 1, 3 and 5 s" in text
    assert "what happened" in text
    assert "what happened" not in str(legend([], False).text.as_arrow_array()[0])


def test_classes_of_a_newer_publisher_are_drawn(scene):
    from mtpgo_training.view.rerun_scene import RerunScene

    seen = scene.predictions[0].prediction
    newer = np.full(len(seen), 200, dtype=np.uint8)
    target = RerunScene("made", viewer=False, scored=True)
    target.log_prediction(0.0, dataclasses.replace(seen, agent_class=newer))
    assert target.close()


def test_a_full_disk_is_one_sentence(scene, tmp_path):
    from mtpgo_training.view.rerun_scene import log_scene

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))  # 0.3 MB are to be written
    try:
        with pytest.raises(ConfigurationError, match=r"a\.rrd cannot be written: File too large"):
            log_scene(scene, tmp_path / "a.rrd")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []
