# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Live scores computed from a bag, compared with the metrics of the evaluation."""

import dataclasses

import numpy as np
import pytest
from recorded_bags import play

from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.predictions import predictions_in_bag
from mtpgo_core.quality import metrics
from mtpgo_core.quality.quality_report import SCORES, WINDOWS_S
from mtpgo_core.task.calibration import GROUPS, calibration_groups
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.evaluation.bags.bag_evaluation import evaluate_bags
from mtpgo_training.evaluation.bags.bag_predictions import read_predictions
from mtpgo_training.evaluation.bags.replayed_quality import quality_rows, replayed_quality
from mtpgo_training.evaluation.scorer import Scorer
from mtpgo_training.reports.honesty.live_scores import live_table
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.table_format import to_text


def slow_scores(bag, predictions, group, time_s):
    """Averages over the predictions whose time has come, one after the other."""
    (recording,) = load_recordings(bag, "bag")
    scorer, steps = Scorer(recording), round(time_s / 0.2)
    end_ns = recording.stamp_ns(int(recording.frames[-1]))
    windows = replay(recording, HistoryConfig(), [p.stamp_ns for p in predictions])
    values = []
    for p, window in zip(predictions, windows, strict=True):
        if p.stamp_ns + time_s * 1e9 > end_ns:
            continue
        groups = calibration_groups(window.agent_class, window.velocity[:, -1])
        own = groups == GROUPS.index(group)
        truth = scorer.ground_truth(p.key, p.stamp_ns, 25, 0.2)
        baseline = scorer.score_baselines(window, truth).paths["cv"].position
        for i in np.flatnonzero(own & truth.mask[:, :steps].any(axis=1)):
            mean, weight = p.mean[i : i + 1, :, :steps, :2], p.weight[i : i + 1]
            covariance = p.covariance[i : i + 1, :, :steps]
            at, mask = truth.position[i : i + 1, :steps], truth.mask[i : i + 1, :steps]
            last = mask[:, -1]
            nees = metrics.nees(mean, weight, covariance, at)[:, -1]
            radius_squared_50 = metrics.radius_squared(0.5) * p.sigma_factor_50[i, steps - 1] ** 2
            straight = baseline[i : i + 1, None, :steps]
            row = {
                "ade": metrics.ade(mean, weight, at, mask),
                "fde": metrics.fde(mean, weight, at, mask),
                "miss_rate": metrics.miss_rate(mean, weight, at, mask),
                "nll": metrics.fnll(mean, weight, covariance, at, mask),
                "coverage_50": np.where(last, nees <= radius_squared_50, np.nan),
                "coverage_90": np.where(last, nees <= metrics.radius_squared(0.9), np.nan),
                "cv_ade": metrics.ade(straight, np.ones((1, 1)), at, mask),
            }
            values.append([row[name][0] for name in SCORES])
    return dict(zip(SCORES, np.nanmean(values, axis=0), strict=True)), len(values)


def test_the_live_scores_are_those_of_the_metrics(bag):
    predictions = read_predictions(bag)
    report = replayed_quality(bag, predictions, HistoryConfig())
    group = GROUPS.index("vehicle_moving")
    for t, time_s in enumerate(metrics.TIMES_S):
        expected, number = slow_scores(bag, predictions, "vehicle_moving", time_s)
        place = (WINDOWS_S.index(300), group, t)
        assert report.predictions[place] == number > 40
        found = dict(zip(SCORES, report.scores[place], strict=True))
        # The published positions are float32, whose steps are 2e-6 to 4e-6 m at these distances.
        assert found == pytest.approx(expected, rel=1e-6, abs=4e-6)
    assert report.agents[2, group, 0] == 8


def test_the_rows_of_json_and_their_table(bag):
    predictions = read_predictions(bag)
    rows = quality_rows(replayed_quality(bag, predictions, HistoryConfig()))
    assert {row["group"] for row in rows} <= set(GROUPS)
    assert len(rows) == 3 * 3 * len({row["group"] for row in rows})
    assert all(row["ade"] is None or row["ade"] >= 0.0 for row in rows)
    text = to_text(live_table(rows))
    assert "moving vehicle, 5 s" in text
    assert live_table([]) is None


def test_odd_messages_are_left_out_as_the_node_does(bag, tmp_path):
    """A message from the future, one that cannot be read, and one without a stamp."""
    predictions = read_predictions(bag)
    odd = tmp_path / "odd"
    with DecodingBagReader(bag) as reader, McapWriter(odd) as out:
        for connection in reader.connections:
            out.add_topic(connection.topic, connection.msgtype)
        everything = reader.messages(reader.connections)
        for i, (connection, received_ns, message) in enumerate(everything):
            out.write(connection.topic, received_ns, message)
            if connection.topic.endswith("objects") and i == 30:
                stamp, data = message.header.stamp, message.data
                for change in ({"sec": stamp.sec + 100}, {"sec": 0, "nanosec": 0}):
                    message.header.stamp = dataclasses.replace(stamp, **change)
                    out.write(connection.topic, received_ns, message)
                message.data = data[:7]
                out.write(connection.topic, received_ns, message)
    expected = replayed_quality(bag, predictions, HistoryConfig())
    found = replayed_quality(odd, predictions, HistoryConfig())
    np.testing.assert_array_equal(found.predictions, expected.predictions)
    np.testing.assert_allclose(found.scores, expected.scores)


def scores_of_two(bag, path, *, leap_s, log_s):
    """Live scores where a bag is played twice, its second stamps and log times so much later."""
    clock_s = 10**6  # by the recorder's clock the stamps are of the past
    with DecodingBagReader(bag) as reader, McapWriter(path) as out:
        for connection in reader.connections:
            out.add_topic(connection.topic, connection.msgtype)
        for add_s, later_s in ((0, clock_s), (leap_s, clock_s + log_s)):
            for connection, received_ns, message in reader.messages(reader.connections):
                stamp = message.header.stamp
                message.header.stamp = dataclasses.replace(stamp, sec=stamp.sec + add_s)
                out.write(connection.topic, received_ns + later_s * 10**9, message)
    return replayed_quality(path, list(predictions_in_bag(path)), HistoryConfig())


def test_stamps_that_leap_between_two_recordings_cost_nothing(bag, tmp_path):
    """The demo plays the second one after a few seconds, with stamps of a minute later."""
    steady = scores_of_two(bag, tmp_path / "steady", leap_s=68, log_s=68)
    found = scores_of_two(bag, tmp_path / "leaps", leap_s=68, log_s=11)
    once = replayed_quality(bag, read_predictions(bag), HistoryConfig())
    np.testing.assert_array_equal(found.predictions[-1], 2 * once.predictions[-1])
    np.testing.assert_array_equal(found.agents[-1], 2 * once.agents[-1])
    np.testing.assert_array_equal(found.scores, steady.scores)


def test_a_bag_played_again_with_the_same_stamps_counts_twice(bag, tmp_path):
    once = replayed_quality(bag, read_predictions(bag), HistoryConfig())
    found = scores_of_two(bag, tmp_path / "loop", leap_s=0, log_s=11)
    np.testing.assert_array_equal(found.predictions[-1], 2 * once.predictions[-1])
    np.testing.assert_array_equal(found.agents[-1], 2 * once.agents[-1])
    np.testing.assert_allclose(found.scores[-1], once.scores[-1], rtol=1e-9)


def test_an_observation_that_was_predicted_from_was_taken_whatever_its_stamp(bag, tmp_path):
    """The node, whose clock is days ahead of the stamps, takes one that leaps, and starts anew."""
    odd, leaps_ns = tmp_path / "odd", read_predictions(bag)[20].stamp_ns
    with DecodingBagReader(bag) as reader, McapWriter(odd) as out:
        for connection in reader.connections:
            out.add_topic(connection.topic, connection.msgtype)
        for connection, received_ns, message in reader.messages(reader.connections):
            if received_ns == leaps_ns:  # an observation and its prediction
                stamp = message.header.stamp
                message.header.stamp = dataclasses.replace(stamp, sec=stamp.sec + 100)
            out.write(connection.topic, received_ns + 10**15, message)
    predictions = list(predictions_in_bag(odd))
    taken = replayed_quality(odd, predictions, HistoryConfig())
    left_out = replayed_quality(odd, predictions[:20] + predictions[21:], HistoryConfig())
    moving, second = GROUPS.index("vehicle_moving"), metrics.TIMES_S.index(1)
    # What was predicted in the second before it is never known.
    counts = [report.predictions[-1, moving, second] for report in (left_out, taken)]
    assert counts[0] - counts[1] == 8 * 5
    assert taken.agents[-1, moving, second] == 2 * 8


def test_a_bag_without_observations_has_no_live_scores(recording, runner, tmp_path):
    bag = play(
        recording.between(None, 2.0), runner, tmp_path / "bare", every=5, observations=False
    )
    result = evaluate_bags([bag], {"01": recording}, {})
    assert result.live == {}
