# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The sentence about a missed deadline names where the time went."""

from mtpgo_ros.node.inference.late_cycle import late_cycle
from mtpgo_ros.node.inference.prediction_request import PredictionRequest

MS = 1_000_000


def request(**times):
    given = {name: value * MS for name, value in times.items()}
    return PredictionRequest("window", 0, 1000 * MS, 160 * MS, 200 * MS, **given)


def test_the_stages_add_up():
    late = request(submitted_ns=1030, begun_ns=1035, predicted_ns=1185, computed_ns=40)
    assert late_cycle(late, 1231 * MS) == (
        "deadline missed: a prediction came 231 ms after its observation, expected within 200 ms "
        "(30 ms in the input; 5 ms until the model began; "
        "150 ms in the model, 40 ms of it on a processor; 46 ms until it was published)"
    )


def test_a_model_that_is_still_at_work_and_one_that_has_not_begun():
    """The watchdog answers for both."""
    at_work = late_cycle(request(submitted_ns=1010, begun_ns=1020), 1300 * MS)
    assert "10 ms until the model began; the model still at work; 280 ms until" in at_work
    waiting = late_cycle(request(submitted_ns=1010), 1300 * MS)
    assert "(10 ms in the input; 290 ms until it was published)" in waiting
