# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The calibration survives in its file; damaged and foreign files are refused."""

import json

import numpy as np
import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.live_calibration.calibration_file import restore, save
from mtpgo_core.live_calibration.live_calibration import LiveCalibration
from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.live_calibration.path_equations import PathFit
from mtpgo_core.live_calibration.path_features import FEATURES
from mtpgo_core.task.task_description import LARGEST_STEPS, HistoryConfig

WEIGHTS = "ab" * 32


@pytest.fixture
def live():
    return LiveCalibration(LiveOptions(), HistoryConfig(), 25)


@pytest.fixture
def saved(live, tmp_path):
    rng = np.random.default_rng(0)
    live.tracker.log_sigma = rng.uniform(-1.0, 1.0, size=live.tracker.log_sigma.shape)
    live.preference.constant_velocity[1] = True
    paths = live.paths.equations.fit
    factor = rng.normal(size=paths.information.shape)
    fit = PathFit.begun(
        rng.normal(size=paths.coefficients.shape),
        rng.uniform(size=paths.belief.shape),
        100.0 * factor @ np.swapaxes(factor, -1, -2) + 3.0 * np.eye(FEATURES),
    )
    live.paths.equations.begin_with(fit)
    path = tmp_path / "calibration.json"
    save(live, WEIGHTS, path)
    return path


def test_what_was_learned_comes_back(live, saved):
    other = LiveCalibration(LiveOptions(), HistoryConfig(), 25)
    assert restore(other, WEIGHTS, saved)
    np.testing.assert_allclose(other.tracker.log_sigma, live.tracker.log_sigma, atol=2e-4)
    assert other.preference.constant_velocity.tolist() == [False, True, *[False] * 6]
    for name in ("coefficients", "belief"):
        found, expected = (getattr(o.paths.equations.fit, name) for o in (other, live))
        np.testing.assert_allclose(found, expected, atol=6e-5)
    found, expected = (o.paths.equations.fit.information for o in (other, live))
    np.testing.assert_allclose(found, expected, atol=6e-3)
    assert saved.stat().st_size < 200_000
    assert [path.name for path in saved.parent.iterdir()] == [saved.name]  # no temporary files


def test_the_longest_horizon_comes_back(tmp_path):
    live, other = (
        LiveCalibration(LiveOptions(), HistoryConfig(), LARGEST_STEPS) for _ in range(2)
    )
    fit = live.paths.equations.fit
    rng = np.random.default_rng(0)
    coefficients = rng.normal(size=fit.coefficients.shape)
    belief = rng.uniform(size=fit.belief.shape)
    live.paths.equations.begin_with(PathFit.begun(coefficients, belief, fit.information))
    save(live, WEIGHTS, tmp_path / "calibration.json")
    assert restore(other, WEIGHTS, tmp_path / "calibration.json")


def test_no_file_yet_is_a_fresh_start(live, tmp_path):
    assert not restore(live, WEIGHTS, tmp_path / "none.json")


def _change(**fields):
    def change(text):
        return json.dumps(json.loads(text) | fields)

    return change


def _first_factor(value):
    def change(text):
        content = json.loads(text)
        content["sigma_factors"]["model"]["vehicle_moving"][1][0] = value
        return json.dumps(content)

    return change


def _path(name, value):
    def change(text):
        content = json.loads(text)
        content["paths"]["vehicle"][name][0][0] = value
        return json.dumps(content)

    return change


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda text: "", "is damaged"),
        (lambda text: text[: len(text) // 2], "is damaged"),
        (lambda text: "[" * 100_000, "is damaged"),
        (lambda text: text + " " * 5_000_000, "more than 5000000 bytes"),
        (lambda text: "\0" * 100, "is damaged"),
        (lambda text: "[]", "is no calibration file"),
        (lambda text: "{}", "is no calibration file"),
        (_change(format=3), "has format 3, expected 4"),
        (_change(weights_sha256="cd" * 32), "is of a model with weights cdcdcdcdcdcd"),
        (_change(weights_sha256=None), "is of a model with weights None"),
        (_change(levels=[0.5, 0.95]), "other levels"),
        (_change(sigma_factors={}), "is damaged"),
        (_change(sigma_factors=[1]), "is damaged"),
        (_change(served_by_constant_velocity=["tram"]), "unknown group 'tram'"),
        (_change(served_by_constant_velocity=[["tram"]]), "is damaged"),
        (_change(served_by_constant_velocity=[1, "tram", None]), "unknown group"),
        (_first_factor(10**400), "is damaged"),
        (_change(served_by_constant_velocity=3), "is damaged"),
        (_first_factor(float("nan")), "factors beyond 0.2 to 8"),
        (_first_factor(9.0), "factors beyond 0.2 to 8"),
        (_change(paths={}), "is damaged"),
        (_change(paths=[]), "is damaged"),
        (_path("belief", 1.5), "belief of paths beyond 0 to 1"),
        (_path("belief", float("nan")), "belief of paths beyond 0 to 1"),
        (_path("belief", "much"), "is damaged"),
        (_path("coefficients", [1e4] * FEATURES), "coefficients of paths beyond -1000 to 1000"),
        (_path("coefficients", [1.0]), "is damaged"),
        (_path("information", [[0.0] * FEATURES] * FEATURES), "not positive definite"),
        (_path("information", [[float("nan")] * FEATURES] * FEATURES), "information of paths"),
        (_path("information", [1.0]), "is damaged"),
        (_first_factor("much"), "is damaged"),
        (_first_factor([1.0]), "is damaged"),
    ],
)
def test_a_bad_file_is_refused_in_one_sentence_and_changes_nothing(live, saved, damage, reason):
    saved.write_text(damage(saved.read_text()))
    other = LiveCalibration(LiveOptions(), HistoryConfig(), 25)
    with pytest.raises(ConfigurationError) as caught:
        restore(other, WEIGHTS, saved)
    assert reason in str(caught.value)
    assert str(saved) in str(caught.value)
    assert len(str(caught.value)) < 400
    assert (other.tracker.log_sigma == 0.0).all()
    assert (other.paths.equations.fit.belief == 0.0).all()


def test_bytes_that_are_no_text_are_refused(live, saved):
    saved.write_bytes(bytes(range(256)))
    with pytest.raises(ConfigurationError, match="is damaged"):
        restore(live, WEIGHTS, saved)


def test_a_folder_is_refused(live, tmp_path):
    with pytest.raises(ConfigurationError, match="cannot be read"):
        restore(live, WEIGHTS, tmp_path)


def test_another_horizon_is_refused(saved):
    with pytest.raises(ConfigurationError, match="shape"):
        restore(LiveCalibration(LiveOptions(), HistoryConfig(), 10), WEIGHTS, saved)


def test_a_failed_write_keeps_the_old_file(live, saved, monkeypatch):
    before = saved.read_bytes()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        save(live, WEIGHTS, saved)
    assert saved.read_bytes() == before
    assert len(list(saved.parent.iterdir())) == 1
