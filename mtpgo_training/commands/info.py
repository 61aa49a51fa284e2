# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo info``: print the description and the model card of a model file."""

from __future__ import annotations

import argparse

from mtpgo_core.completion import completed_by
from mtpgo_core.errors import ModelFileError
from mtpgo_core.task.model_file import find_model, model_card, read_model, shipped_models
from mtpgo_core.task.task_description import TASK_FILE
from mtpgo_training.export.model_info import model_text


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo info`` to the command line."""
    parser = subparsers.add_parser("info", help="print the description of a model file")
    completed_by(
        parser.add_argument("model", help="model file, or name of a shipped model"),
        shipped_models,
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo info``."""
    path = find_model(args.model)
    model = read_model(path)
    try:
        print(model_text(model.task))
    except (AttributeError, TypeError, KeyError, ValueError) as error:
        raise ModelFileError(
            f"model file {path} has a {TASK_FILE} whose training or metrics cannot be printed: "
            f"{type(error).__name__}: {error}"
        ) from error
    print(f"file       sha256 {model.archive.sha256}")
    card = model_card(path)
    if card is not None:
        print(f"\n{path.with_suffix('.md')}:\n\n{card.rstrip()}")
    return 0
