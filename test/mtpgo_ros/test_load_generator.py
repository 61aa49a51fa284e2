# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The arguments of the load generator; the benchmark's tests run it with the node."""

import pytest

from mtpgo_ros.load_generator import main


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
