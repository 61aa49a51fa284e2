# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command ``mtpgo``: everything offline. A subcommand's module is loaded when it is called."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence

from mtpgo_core.errors import MtpgoError

COMMANDS = {
    "convert": "recordings into rosbag2 MCAP bags",
    "simulate": "recordings of simulated traffic (Eclipse SUMO)",
    "train": "train a model on recordings",
    "curve": "draw the learning curves of runs",
    "export": "export a trained model for the node",
    "evaluate": "score a model on recordings",
    "info": "what a model file says about itself",
    "benchmark": "measure the speed of the model",
    "demo": "play a recording through the node and score it",
}
"""The help of every subcommand; the module ``commands.NAME`` defines its ``add_parser``."""

EXTRA_MODULES = {"jinja2", "lightning", "matplotlib", "pandas", "psutil", "tensorboard", "yaml"}
"""What the extra ``training`` brings, as it is imported."""


def build_parser(command: str | None = None) -> argparse.ArgumentParser:
    """The parser; only the module of ``command`` is loaded, the others are listed by name."""
    parser = argparse.ArgumentParser(
        prog="mtpgo", description="Multimodal trajectory prediction for traffic, offline."
    )
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, text in COMMANDS.items():
        if name == command:
            importlib.import_module(f"mtpgo_training.commands.{name}").add_parser(subparsers)
        else:
            subparsers.add_parser(name, help=text, add_help=False)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command line; the exit status.

    Bad input gives one line on stderr and 2, an interrupt 130, an output that nobody reads to its
    end 141 and no word, as the shell has it.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    command = next((word for word in arguments if not word.startswith("-")), None)
    try:
        args = build_parser(command if command in COMMANDS else None).parse_args(arguments)
        status = int(args.run(args) or 0)
        sys.stdout.flush()  # here, where somebody listens to what comes of it
        return status
    except BrokenPipeError:
        # Whoever read the output has seen enough; Python would complain once more at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except MtpgoError as error:
        print(f"mtpgo: {error}", file=sys.stderr)
        return 2
    except ModuleNotFoundError as error:
        print(f"mtpgo: {missing_module(error, command)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("mtpgo: interrupted", file=sys.stderr)
        return 130


def missing_module(error: ModuleNotFoundError, command: str | None) -> str:
    """The sentence for a library that this installation lacks."""
    module = (error.name or str(error)).split(".")[0].split()[0]
    if module not in EXTRA_MODULES:
        return f"{command} needs the Python module {module!r}, which is not installed"
    return (
        f"{command} needs {module}, which comes with the extra 'training': "
        "pip install 'mtpgo_ros[training]'"
    )


if __name__ == "__main__":
    sys.exit(main())
