# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Values of command-line options: what is allowed, and the sentence for the rest."""

import argparse

import pytest

from mtpgo_training.commands.arguments.argument_types import (
    positive_integer,
    positive_number,
    share,
)


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        (positive_integer, "1", 1),
        (positive_integer, " 20 ", 20),
        (positive_number, "1e-3", 0.001),
        (positive_number, "7", 7.0),
        (share, "0", 0.0),
        (share, "0.9", 0.9),
    ],
)
def test_values_within_the_limits_are_converted(kind, text, value):
    assert kind(text) == value
    assert type(kind(text)) is type(value)


@pytest.mark.parametrize(
    ("kind", "texts", "expected"),
    [
        (positive_integer, ("0", "-3", "1.5", "many", ""), "at least 1"),
        (positive_number, ("0", "-0.1", "inf", "nan", "fast"), "a number above 0"),
        (share, ("-0.01", "0.91", "inf", "nan", "half"), "a number from 0 to 0.9"),
    ],
)
def test_other_values_are_refused_with_what_is_expected(kind, texts, expected):
    for text in texts:
        with pytest.raises(argparse.ArgumentTypeError) as caught:
            kind(text)
        assert str(caught.value) == f"{text} is given, expected {expected}"


def test_a_parser_prints_the_sentence(capsys):
    parser = argparse.ArgumentParser()
    parser.add_argument("--rate", type=positive_number)
    with pytest.raises(SystemExit):
        parser.parse_args(["--rate", "none"])
    assert "argument --rate: none is given, expected a number above 0" in capsys.readouterr().err
