# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Averages of the last minutes, by hand-worked numbers."""

import numpy as np
import pytest
from observed_stream import S_NS, Stream

from mtpgo_core.quality.quality_report import SCORES, WINDOWS_S
from mtpgo_core.quality.rolling_scores import RollingScores
from mtpgo_core.schema import AgentClass, Source
from mtpgo_core.task.calibration import GROUPS

MOVING_CAR = GROUPS.index("vehicle_moving")


def run(seconds, *, offset_m=0.0, cars=1, scores=None, stream=None, start_s=0.0):
    """Cars at 10 m/s, predicted ``offset_m`` beside their way at each of 5 observations/s."""
    stream = stream or Stream()
    scores = scores or RollingScores(0.2)
    for time_s in start_s + 0.2 * np.arange(round(5 * seconds)):
        places = {k: (10.0 * time_s, 50.0 * k) for k in range(1, cars + 1)}
        scores.update(stream.observe(time_s, places))
        stream.predict(offset_m, modes=1)
    return scores, stream


def row(scores, window_s=60, group=MOVING_CAR, time=0):
    report = scores.report({})
    place = (WINDOWS_S.index(window_s), group, time)
    found = dict(zip(SCORES, report.scores[place].tolist(), strict=True))
    return found | {"agents": report.agents[place], "predictions": report.predictions[place]}


def test_the_scores_of_known_errors():
    scores, _ = run(20.0, offset_m=1.0, cars=2)
    found = row(scores, time=2)
    assert found["agents"] == 2
    assert found["predictions"] == 2 * (100 - 25)
    assert found["ade"] == pytest.approx(1.0, abs=1e-5)
    assert found["fde"] == pytest.approx(1.0, abs=1e-5)
    assert found["cv_ade"] == pytest.approx(0.0, abs=1e-6)
    assert found["miss_rate"] == 0.0
    # variance across: 0.2^2 + 0.3^2 5^2 + 0.1 5^3 / 3, and along with a density of 1
    across, along = 2.29 + 0.1 * 125 / 3, 2.29 + 125 / 3
    nll = np.log(2 * np.pi) + 0.5 * np.log(across * along) + 0.5 / across
    assert found["nll"] == pytest.approx(nll, rel=1e-4)
    assert found["coverage_50"] == found["coverage_90"] == 1.0


def test_misses_and_ellipses_that_do_not_hold_the_truth():
    scores, _ = run(20.0, offset_m=2.5)
    at_one_second, at_five = row(scores, time=0), row(scores, time=2)
    assert at_one_second["miss_rate"] == at_five["miss_rate"] == 1.0
    # 2.5^2 / (0.2^2 + 0.3^2 + 0.1 / 3) = 38 at 1 s; 6.25 / 6.46 = 0.97 at 5 s; limits 1.39, 4.61
    assert at_one_second["coverage_90"] == 0.0
    assert at_five["coverage_50"] == at_five["coverage_90"] == 1.0


def test_the_windows_forget():
    scores, stream = run(70.0, offset_m=1.0)
    run(66.0, scores=scores, stream=stream, start_s=70.0)
    assert row(scores, 60)["ade"] == pytest.approx(0.0, abs=1e-3)
    assert 0.4 < row(scores, 300)["ade"] < 0.6
    run(1.0, scores=scores, stream=stream, start_s=1500.0)
    assert row(scores, 1800)["predictions"] > 0
    run(1.0, scores=scores, stream=stream, start_s=4000.0)
    assert row(scores, 1800)["predictions"] == row(scores, 1800)["agents"] == 0
    assert np.isnan(row(scores, 1800)["ade"])


def test_an_agent_counts_once_however_often_it_is_predicted():
    scores, stream = run(30.0, cars=3)
    assert row(scores)["agents"] == 3
    run(30.0, cars=2, scores=scores, stream=stream, start_s=100.0)  # other tracks by then
    assert row(scores, 60)["agents"] == 2
    assert row(scores, 300)["agents"] == 5


def test_scores_go_on_where_the_clock_is_set_back():
    scores, stream = run(30.0, offset_m=1.0)
    before = row(scores)["predictions"]
    run(10.0, scores=scores, stream=stream, start_s=-60.0)
    assert row(scores)["predictions"] == before + 50 - 5
    assert row(scores, 300)["ade"] == pytest.approx(before / (before + 45), abs=1e-3)


def test_a_clock_that_is_set_to_and_fro_by_years():
    """As of a bag that loops and begins before its computer was told the time."""
    scores, stream, found = RollingScores(0.2), Stream(), []
    for start_s in [0.0, 1.7e9] * 8:
        for time_s in 0.2 * np.arange(10):
            scores.update(stream.observe(start_s + time_s, {1: (10.0 * time_s, 0.0)}))
            stream.predict(modes=1)
        found.append(int(row(scores)["predictions"]))
    # What came before a jump forward is longer ago than any window; a jump back takes no time.
    assert found == [5, *[5, 10] * 7, 5]


def test_groups_are_kept_apart():
    stream, scores = Stream(), RollingScores(0.2)
    for i in range(50):
        kind = AgentClass.PEDESTRIAN if i < 25 else AgentClass.CAR
        key = 1 if i < 25 else 2
        speed = 0.0 if i < 25 else 10.0
        scores.update(
            stream.observe(
                0.2 * i, {key: (speed * 0.2 * i, 0.0)}, velocity=(speed, 0.0), agent_class=kind
            )
        )
        stream.predict()
    report = scores.report({})
    used = {GROUPS[g] for g in np.flatnonzero(report.predictions[0, :, 0])}
    assert used == {"pedestrian_standing", "vehicle_moving"}


def test_predictions_by_constant_velocity_are_counted_apart():
    stream, scores = Stream(), RollingScores(0.2)
    for i in range(20):
        scores.update(stream.observe(0.2 * i, {1: (2.0 * i, 0.0)}))
        stream.predict(source=Source.MODEL if i < 10 else Source.CONSTANT_VELOCITY)
    report = scores.report({})
    assert report.predictions[0, MOVING_CAR, 0] == 15
    assert report.by_model[0, MOVING_CAR, 0] == 10


def test_the_memory_is_bounded():
    scores, stream = RollingScores(0.2), Stream()
    size = scores.bytes
    for i in range(200):
        scores.update(stream.observe(0.2 * i, {1 + i // 10: (2.0 * i, 0.0)}))
        stream.predict()
    assert size < 3e6
    assert scores.bytes - size < 16 * 3 * 20


def test_a_truth_just_before_the_end_of_a_span_counts_in_it_and_is_kept():
    """Stamps that were seconds in floating point may be a nanosecond before a predicted time."""
    stream, scores = Stream(), RollingScores(0.2)
    for step in range(52):
        early_s = 1e-9 if step % 25 == 0 else 0.0  # spans end at 5 s and 10 s
        scores.update(stream.observe(0.2 * step - early_s, {1: (2.0 * step, 0.0)}))
        stream.predict(modes=1)
        assert row(scores)["predictions"] == max(0, step - 4)


def test_a_random_stream_against_a_plain_recomputation():
    """Cars that come and go, missed now and then, with jitter: every prediction one by one."""
    rng = np.random.default_rng(5)
    stream, scores = Stream(), RollingScores(0.2)
    seen, predicted, cars = {}, [], {}
    for cycle in range(250):
        now_s = 0.2 * cycle + rng.uniform(-0.004, 0.004)
        now_ns = round((100 + now_s) * S_NS)
        cars = {k: end_s for k, end_s in cars.items() if end_s > now_s}
        if len(cars) < 4:
            cars[cycle] = now_s + rng.uniform(2.0, 20.0)
        places = {
            k: (10.0 * now_s, 30.0 * k + np.sin(now_s + k)) for k in cars if rng.random() < 0.85
        }
        for k, place in places.items():
            seen.setdefault(k, []).append((now_ns, np.array(place)))
        if not places:
            continue
        scores.update(stream.observe(now_s, places))
        aside_m = float(rng.normal())
        stream.predict(aside_m, modes=1)
        window = stream.history.window()
        here = window.valid[:, -1]
        for key, place in zip(window.key[here, 0], window.position[here, -1], strict=True):
            predicted.append((window.stamp_ns, int(key), place + np.array([0.0, aside_m])))
    report = scores.report({})
    for t, time_s in enumerate((1, 3, 5)):
        rows = []
        for stamp_ns, key, place in predicted:
            truth = between(seen[key], stamp_ns + time_s * S_NS)
            if truth is not None:
                rows.append((np.hypot(*(place + np.array([10.0 * time_s, 0.0]) - truth)), key))
        far, keys = (np.array(column) for column in zip(*rows, strict=True))
        cell = (WINDOWS_S.index(300), MOVING_CAR, t)
        assert report.predictions[cell] == len(far) > 100
        assert report.agents[cell] == len(np.unique(keys)) > 5
        found = dict(zip(SCORES, report.scores[cell], strict=True))
        assert found["fde"] == pytest.approx(far.mean(), rel=1e-5)
        assert found["miss_rate"] == pytest.approx((far > 2.0).mean())


def between(seen, due_ns):
    """Where a car was, from observations at most 0.5 s apart, None where that is not known."""
    stamps = [stamp for stamp, _ in seen]
    after = next((i for i, stamp in enumerate(stamps) if stamp >= due_ns - 1000), None)
    if after is None:
        return None
    if stamps[after] <= due_ns + 1000:
        return seen[after][1]
    if after == 0 or stamps[after] - stamps[after - 1] > S_NS // 2:
        return None
    share = (due_ns - stamps[after - 1]) / (stamps[after] - stamps[after - 1])
    return (1.0 - share) * seen[after - 1][1] + share * seen[after][1]
