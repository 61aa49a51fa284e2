# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
# PYTHON_ARGCOMPLETE_OK
"""The command ``mtpgo``; the module of a subcommand is imported when it is called."""

from __future__ import annotations

import argparse
import importlib
import io
import os
import sys
from collections.abc import Sequence

from mtpgo_core.completion import complete, words_so_far
from mtpgo_core.errors import MtpgoError
from mtpgo_core.versions import add_version

COMMANDS = {
    "data": "describe recordings and their defects",
    "convert": "convert recordings into rosbag2 MCAP bags",
    "simulate": "simulate traffic as recordings (Eclipse SUMO)",
    "train": "train a model on recordings",
    "crossval": "train without some sites and test on them, until each was left out",
    "study": "the paper's tables by one command",
    "adapt": "adapt a model to recordings of your site",
    "curve": "draw the learning curves of runs",
    "export": "export a trained model for the node",
    "evaluate": "score a model on recordings",
    "info": "print the description of a model file",
    "benchmark": "measure the speed of model, node and tools",
    "demo": "play a recording through the node and score it",
    "layouts": "write layouts for RViz and Foxglove",
    "view": "show predictions over time: page, animation, rerun",
}
"""Subcommand -> help; its ``add_parser`` is in the module ``commands.NAME``."""

EXTRA_MODULES = {
    **dict.fromkeys(
        (
            "jinja2",
            "lightning_fabric",
            "matplotlib",
            "psutil",
            "scipy",
            "tensorboard",
            "torch_geometric",
            "yaml",
        ),
        "training",
    ),
    "PIL": "view",
    "cloudpickle": "fleet",
    "cryptography": "fleet",
    "dask": "fleet",
    "distributed": "fleet",
    "google": "datasets",
    "imageio_ffmpeg": "view",
    "pyarrow": "datasets",
    "rclpy": "ros",
    "sumo": "simulation",
    "rerun": "view",
}
"""Extra of the package by the top-level modules of the packages in it."""


def build_parser(command: str | None = None) -> argparse.ArgumentParser:
    """Return the parser.

    Args:
        command: subcommand whose module is imported; the others are listed by name only.
    """
    parser = argparse.ArgumentParser(
        prog="mtpgo", description="Multimodal trajectory prediction for traffic, offline."
    )
    add_version(parser)
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, text in COMMANDS.items():
        if name == command:
            importlib.import_module(f"mtpgo_training.commands.{name}").add_parser(subparsers)
        else:
            subparsers.add_parser(name, help=text, add_help=False)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command line and return the exit status.

    The status is 2 and one line on stderr for bad input, 130 after an interrupt, and 141 without a
    message if the reader of the output closed it, as for a process ended by SIGPIPE.

    Args:
        argv: arguments, by default those of the process.
    """
    complete(lambda: build_parser(_command_in(words_so_far())))
    arguments = list(sys.argv[1:] if argv is None else argv)
    if isinstance(sys.stdout, io.TextIOWrapper):
        # As on stderr: names of files need not be text that the terminal can show.
        sys.stdout.reconfigure(errors="backslashreplace")
    command = _command_in(arguments)
    try:
        args = build_parser(command).parse_args(arguments)
        args.words = arguments
        status = int(args.run(args) or 0)
        sys.stdout.flush()  # here, so that a closed output is caught below
        return status
    except BrokenPipeError:
        # Python flushes again at exit, which would report the closed output a second time.
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


def _command_in(words: Sequence[str]) -> str | None:
    """Return the subcommand among words, None if there is none yet."""
    first = next((word for word in words if not word.startswith("-")), None)
    return first if first in COMMANDS else None


def missing_module(error: ModuleNotFoundError, command: str | None) -> str:
    """Return the error message for a library that is not installed."""
    module = (error.name or str(error)).split(".")[0].split()[0]
    if module not in EXTRA_MODULES:
        return f"{command} needs the Python module {module!r}, which is not installed"
    extra = EXTRA_MODULES[module]
    return (
        f"{command} needs {module}, which comes with the extra {extra!r}: "
        f"pip install 'mtpgo_ros[{extra}]'"
    )


if __name__ == "__main__":
    sys.exit(main())
