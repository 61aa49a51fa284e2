# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The next command can be pasted into a shell."""

import argparse
import shlex

from mtpgo_training.commands.arguments.next_command import command_text, same_command


def args(*words):
    return argparse.Namespace(words=list(words))


def test_words_are_quoted():
    words = ["mtpgo", "export", "my runs/it's", "-o", "a$b.pt"]
    assert shlex.split(command_text(*words)) == words
    given = ["train", "default", "--data", "a b", "--out", 'x"y']
    assert shlex.split(same_command(args(*given))) == ["mtpgo", *given]


def test_words_are_added_once():
    assert same_command(args("train", "c"), "--resume") == "mtpgo train c --resume"
    assert same_command(args("train", "--resume"), "--resume") == "mtpgo train --resume"


def test_options_are_left_out_however_they_are_written():
    for given in (["--init-from", "x"], ["--init-from=x"], ["--init", "x"]):
        words = ["train", "c", *given, "--seed", "3"]
        assert same_command(args(*words), without=["--init-from"]) == "mtpgo train c --seed 3"


def test_options_are_added_before_a_lone_double_dash():
    given = args("train", "--out", "run", "--", "-c.yaml")
    assert same_command(given, "--resume") == "mtpgo train --out run --resume -- -c.yaml"
