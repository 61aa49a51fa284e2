# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo info``: the description and the card of a model file."""

from __future__ import annotations

import argparse

from mtpgo_core.task.model_file import find_model, load_task, model_card
from mtpgo_training.export.model_info import card


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo info`` to the command line."""
    parser = subparsers.add_parser("info", help="what a model file says about itself")
    parser.add_argument("model", help="model file, or name of a shipped model")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo info``."""
    path = find_model(args.model)
    print(card(load_task(path)))
    text = model_card(path)
    if text is not None:
        print(f"\n{path.with_suffix('.md')}:\n\n{text.rstrip()}")
    return 0
