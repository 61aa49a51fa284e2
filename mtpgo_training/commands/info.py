# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo info``: print the description and the model card of a model file."""

from __future__ import annotations

import argparse

from mtpgo_core.task.model_file import find_model, load_task, model_card
from mtpgo_training.export.model_info import model_text


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo info`` to the command line."""
    parser = subparsers.add_parser("info", help="print the description of a model file")
    parser.add_argument("model", help="model file, or name of a shipped model")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo info``."""
    path = find_model(args.model)
    print(model_text(load_task(path)))
    card = model_card(path)
    if card is not None:
        print(f"\n{path.with_suffix('.md')}:\n\n{card.rstrip()}")
    return 0
