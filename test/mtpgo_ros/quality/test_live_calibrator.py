# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node calibrates itself while it runs, over DDS."""

import json
import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from ros_helpers import traffic

from mtpgo_core.schema import CalibrationStage, Source
from mtpgo_core.task.task_description import TaskDescription
from mtpgo_ros.node.model_host import ModelHost
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters
from mtpgo_ros.quality.live_calibrator import LiveCalibrator

OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN
AGENTS, SHIPPED_VARIANCE = 12, 0.1 + 1.0  # of the tiny model after 1 s (m^2)


def drive(bench, seconds, start_s=0.0):
    """Let cars drive at constant velocity, which the tiny model predicts exactly."""
    last = None
    for step in range(round(seconds / 0.2)):
        last = bench.predict(traffic(start_s + 0.2 * step, agents=AGENTS))
    return last


def sideways_m(prediction):
    """How far to the left the paths lead in all steps after the first (m)."""
    return prediction.mean[:, 0, -1, 1] - prediction.mean[:, 0, 0, 1]


def test_online_factors_are_served_shown_and_survive_a_restart(bench, tmp_path):
    path = tmp_path / "calibration.json"
    first = bench(calibration_file=str(path), path_smoothing=0.0)
    fresh = first.predict(traffic(0.0, agents=AGENTS))
    assert fresh.covariance[:, 0, 4, 0, 0] == pytest.approx(SHIPPED_VARIANCE, rel=1e-5)
    assert (fresh.calibration == CalibrationStage.ONLINE).all()
    last = drive(first, 14.0, start_s=0.2)
    served = last.covariance[:, 0, 4, 0, 0]
    assert (served < 0.7 * SHIPPED_VARIANCE).all()
    assert (last.sigma_factor_50[:, 4] < 0.95).all()
    assert last.weight[0] == pytest.approx([0.5, 0.3, 0.2], abs=1e-6)
    assert (np.diff(last.covariance[..., 0, 0], axis=2) > -1e-6).all()
    factor = np.exp(first.node._model.calibrator.live.tracker.log_sigma[0, 1, 1, 4])
    assert factor**2 * SHIPPED_VARIANCE == pytest.approx(served[0], rel=0.1)
    expected = {"calibration": "online", "restored": "false", "agents_vehicle_moving": "12.0"}
    values = first.status("calibration", OK, **expected)
    # The status may be of some observations before.
    assert float(values["model_sigma_90_vehicle_moving"].split()[0]) < 0.9
    first.node.trigger_deactivate()
    assert json.loads(path.read_text())["weights_sha256"] == "0" * 64

    again = bench(calibration_file=str(path))
    restored = again.predict(traffic(0.0, agents=AGENTS))
    assert restored.covariance[:, 0, 4, 0, 0] == pytest.approx(served, rel=0.1)
    again.status("calibration", OK, restored="true")

    text = path.read_text()
    path.write_text(text.replace("0" * 64, "1" * 64))
    other = bench(calibration_file=str(path))
    after = other.predict(traffic(0.0, agents=AGENTS))
    assert after.covariance[:, 0, 4, 0, 0] == pytest.approx(SHIPPED_VARIANCE, rel=1e-5)
    other.status("calibration", WARN, "is of a model with weights 111111111111", restored="false")

    path.write_text(text[:1000])
    damaged = bench(calibration_file=str(path))
    after = damaged.predict(traffic(0.0, agents=AGENTS))
    assert after.covariance[:, 0, 4, 0, 0] == pytest.approx(SHIPPED_VARIANCE, rel=1e-5)
    damaged.status("calibration", WARN, "is damaged", restored="false")


def test_corrected_paths_are_served_shown_and_survive_a_restart(bench, tmp_path):
    """The model lets all cars drift to the left, which none does."""
    path = tmp_path / "calibration.json"
    options = {"path_smoothing": 0.0, "calibration_file": str(path)}
    first = bench("wrong", **options)
    fresh = first.predict(traffic(0.0, agents=AGENTS))
    drift_m = sideways_m(fresh)
    assert (fresh.calibration == CalibrationStage.ONLINE).all()
    last = drive(first, 12.0, start_s=0.2)
    assert (last.calibration == CalibrationStage.ONLINE_PATH).all()
    assert (sideways_m(last) < 0.75 * drift_m).all()
    values = first.status("calibration", OK, calibration="online")
    assert float(values["path_across_vehicle"].split()[0]) > 0.5
    first.node.trigger_deactivate()

    again = bench("wrong", **options)
    restored = again.predict(traffic(0.0, agents=AGENTS))
    assert (sideways_m(restored) < 0.8 * drift_m).all()
    assert (restored.calibration == CalibrationStage.ONLINE_PATH).all()

    plain = bench("wrong", **options, correct_paths=False)
    shipped = drive(plain, 4.0)
    assert sideways_m(shipped) == pytest.approx(drift_m, abs=1e-3)
    assert (shipped.calibration == CalibrationStage.ONLINE).all()
    values = plain.status("calibration", OK, restored="true")
    assert "path_across_vehicle" not in values


@pytest.mark.parametrize("calibration", ["shipped", "off"])
def test_without_online_nothing_is_corrected(bench, calibration):
    b = bench(calibration=calibration)
    last = drive(b, 8.0)
    assert last.covariance[:, 0, 4, 0, 0] == pytest.approx(SHIPPED_VARIANCE, rel=1e-5)
    assert (last.sigma_factor_50 == 1.0).all()
    assert (last.calibration == CalibrationStage.NONE).all()  # the tiny model's file has none
    b.status("calibration", OK, calibration, calibration=calibration)


def test_constant_velocity_serves_where_the_model_has_been_worse(bench):
    b = bench("wrong", prefer="best", prefer_time=4.0, prefer_agents=5)
    first = b.predict(traffic(0.0, agents=AGENTS))
    assert (first.source == Source.MODEL).all()
    last = drive(b, 8.0, start_s=0.2)
    assert (last.source == Source.PREFERRED_CONSTANT_VELOCITY).all()
    assert last.mean[:, 0, 4, 1] == pytest.approx(0.0, abs=1e-3)
    assert last.weight[0] == pytest.approx([1.0, 0.0, 0.0])
    assert (last.calibration == CalibrationStage.ONLINE).all()
    values = b.status("calibration", WARN, "constant velocity has been better than the model")
    assert values["served_by_vehicle_moving"] == "constant velocity"
    model_m, constant_m = map(float, values["error_m_model_and_cv_vehicle_moving"].split())
    assert model_m > 1.0 > constant_m
    # It works, it is only worse.
    b.status("model", OK, f"constant velocity serves {AGENTS} of {AGENTS}", fallback_agents="0")


def test_road_users_after_an_activation_are_others_than_those_before(bench):
    """What one road user may change is limited, and how many there are is counted."""
    b = bench(prefer="best", prefer_time=600.0)
    drive(b, 1.0)
    preference = b.node._model.calibrator.live.preference
    assert preference.agents.sum() == AGENTS
    b.node.trigger_deactivate()
    b.node.trigger_activate()
    b.be_patient()
    b.until(lambda: b.node._pipeline.objects._subscription is not None)
    b.until(lambda: b.node._pipeline.objects._subscription.get_publisher_count() > 0)
    b.until(lambda: b.objects.get_subscription_count() > 0)
    drive(b, 1.0, start_s=100.0)
    assert preference.agents.sum() == 2 * AGENTS


def test_what_an_observation_teaches_is_served_with_the_prediction_that_it_starts(
    bench, monkeypatch
):
    """However the threads run, so that two runs on a bag are equal."""
    b = bench()
    calibrator, order = b.node._model.calibrator, []
    observe, serve = calibrator.observe, calibrator.serve

    def slow(history, report):
        time.sleep(0.02)  # the tiny model is ready sooner
        observe(history, report)
        order.append("observe")

    def served(prediction, window):
        order.append("serve")
        return serve(prediction, window)

    monkeypatch.setattr(calibrator, "observe", slow)
    monkeypatch.setattr(calibrator, "serve", served)
    for step in range(3):
        b.predict(traffic(0.2 * step))
    assert order == 3 * ["observe", "serve"]


def test_an_unwritable_file_is_reported_and_the_node_continues(bench, tmp_path):
    b = bench(calibration_file=str(tmp_path / "missing" / "calibration.json"))
    b.status("calibration", WARN, "cannot be read")
    assert len(b.predict(traffic(0.0, agents=AGENTS))) == AGENTS


@pytest.fixture
def calibrator(tmp_path):
    """A function that makes calibrators with one file."""
    task = TaskDescription()

    def make(**parameters):
        path = str(tmp_path / "calibration.json")
        return LiveCalibrator(PredictorParameters(calibration_file=path, **parameters), task)

    return make


def test_a_file_that_could_not_be_used_is_no_problem_once_it_is_written(calibrator, tmp_path):
    (tmp_path / "calibration.json").write_text('{"kind":"mtpgo live calibration","format":1}')
    one = calibrator()
    assert "has format 1, expected 4" in one.file_error
    one.close()
    assert not one.file_error
    (tmp_path / "calibration.json").unlink()
    (tmp_path / "calibration.json").mkdir()
    one.close()
    assert "cannot be written: Is a directory" in one.file_error
    (tmp_path / "calibration.json").rmdir()
    one.close()
    assert not one.file_error


@pytest.mark.parametrize("content", [b"{}", b"PK\x03\x04 a model", b'{"mine": 1}\n'])
def test_a_file_of_another_kind_is_never_overwritten(calibrator, tmp_path, content):
    path = tmp_path / "calibration.json"
    path.write_bytes(content)
    one = calibrator()
    assert one.file_error
    one.close()
    assert one.file_error == f"{path} is no calibration file and is not overwritten"
    assert path.read_bytes() == content
    path.write_bytes(b"")  # as touch makes it
    one.close()
    assert "was written by another process as well" in one.file_error
    assert json.loads(path.read_bytes())["format"] == 4


def test_a_node_without_its_model_keeps_what_was_learned_about_it(tmp_path, calibrator):
    calibrator().close()
    path = tmp_path / "calibration.json"
    before = path.read_bytes()
    host = ModelHost(
        PredictorParameters(model="/no/such.pt", require_model=False, calibration_file=str(path))
    )
    host.calibrator.close()
    assert host.calibrator.file_error == ""
    assert path.read_bytes() == before


def test_two_nodes_with_one_file_are_reported(calibrator):
    one, other = calibrator(), calibrator()
    one.close()
    assert not one.file_error
    other.close()
    assert "was written by another process as well, expected one file" in other.file_error
    other.close()
    assert not other.file_error
    one.close()
    assert "was written by another process as well" in one.file_error


def test_a_preference_in_the_file_has_no_effect_where_the_model_is_wanted(calibrator):
    one = calibrator(prefer="best")
    one.live.preference.constant_velocity[1] = True
    one.close()
    assert calibrator(prefer="best").preferred == ["vehicle_moving"]
    assert calibrator(prefer="model").preferred == []
