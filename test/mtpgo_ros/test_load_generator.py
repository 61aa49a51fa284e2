# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The arguments of the load generator; the benchmark's tests run it with the node."""

import threading
import time
from types import SimpleNamespace

import pytest

from mtpgo_ros.load_generator import LAST_ANSWER_S, LoadPlan, _publish, main


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], ["--output"]),
        (["-o", "x", "--agents", "2.5"], ["2.5", "whole number"]),
        (["-o", "x", "--input-rate", "0"], ["0 given", "above 0"]),
    ],
)
def test_a_wrong_argument_is_one_line(signals, arguments, words, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    for word in words:
        assert word in said


def test_a_signal_ends_it_without_waiting_for_the_last_answers():
    plan = LoadPlan(1, 10.0, 0.0, 60.0, 60.0, "/predictor", False)
    node = SimpleNamespace(received=[(0, 0, 1, 0)], measured_from=None, measured_until=0)
    over = threading.Event()
    begin_s = time.monotonic()
    _publish(plan, node, lambda: True, over)
    assert time.monotonic() - begin_s < LAST_ANSWER_S
    assert over.is_set()
