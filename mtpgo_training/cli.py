# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
# PYTHON_ARGCOMPLETE_OK
"""The command ``mtpgo``; the module of a subcommand is imported when it is called."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from types import FrameType
from typing import Any, NoReturn

from mtpgo_core.completion import complete, words_so_far
from mtpgo_core.errors import MtpgoError, did_you_mean, reason_of
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
    "google_crc32c": "datasets",
    "imageio_ffmpeg": "view",
    "pyarrow": "datasets",
    "rclpy": "ros",
    "sumo": "simulation",
    "rerun": "view",
}
"""Extra of the package by the top-level modules of the packages in it."""


class _Parser(argparse.ArgumentParser):
    """Reports wrong arguments in one sentence instead of the whole usage.

    It also says where its help cannot be written, which argparse drops where there is no buffer.

    Attributes:
        command: name of the subcommand that is called, None if there is none.
    """

    command: str | None = None

    def error(self, message: str) -> NoReturn:
        """Print one sentence about wrong arguments and exit with status 2."""
        # What no parser knows is reported by the outermost one, whose help does not explain it.
        name = self.prog if self.command is None else f"{self.prog} {self.command}"
        self.exit(2, f"{name}: {' '.join(message.split())} (see {name} --help)\n")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        try:
            super()._check_value(action, value)
        except argparse.ArgumentError as error:
            hint = did_you_mean(str(value), map(str, action.choices or ()))
            raise argparse.ArgumentError(action, f"{error.message}{hint}") from error

    def _print_message(self, message: str, file: Any = None) -> None:
        stream = sys.stderr if file is None else file
        if message:
            stream.write(message)


def build_parser(command: str | None = None) -> argparse.ArgumentParser:
    """Return the parser.

    Args:
        command: subcommand whose module is imported; the others are listed by name only.
    """
    parser = _Parser(
        prog="mtpgo", description="Multimodal trajectory prediction for traffic, offline."
    )
    parser.command = command
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

    The status is 2 and one line on stderr for bad input and for what the system refuses, such as
    a write to a full disk; 130 after an interrupt, 128 and the number of any other signal that
    ended it, and 141 without a message if the reader of the output closed it, as for a process
    ended by SIGPIPE.

    Args:
        argv: arguments, by default those of the process.
    """
    complete(lambda: build_parser(_command_in(words_so_far())))
    arguments = list(sys.argv[1:] if argv is None else argv)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by who started the program, as cron may do
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            # Names of files need not be text that the terminal can show.
            stream.reconfigure(errors="backslashreplace")
    command = _command_in(arguments)
    try:
        with ended_by_signals():
            try:
                args = build_parser(command).parse_args(arguments)
                args.words = arguments
                status = int(args.run(args) or 0)
            except SystemExit:  # argparse has printed its help, or an action its list
                sys.stdout.flush()
                raise
            sys.stdout.flush()  # here, so that a closed output is caught below
            return status
    except BrokenPipeError:
        _drop_output()
        return 141
    except MtpgoError as error:
        print(f"mtpgo: {error}", file=sys.stderr)
        return 2
    except ModuleNotFoundError as error:
        print(f"mtpgo: {missing_module(error, command)}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"mtpgo: {_where(error)}{reason_of(error)}", file=sys.stderr)
        _drop_output()
        return 2
    except KeyboardInterrupt:
        print("mtpgo: interrupted", file=sys.stderr)
        return 130


def _where(error: OSError) -> str:
    """Return the beginning of a sentence about an error, empty where it does not say what of."""
    if error.filename is not None:
        return f"{error.filename}: "
    try:
        os.getcwd()
    except OSError:  # relative paths lead nowhere
        return "the working directory cannot be used: "
    return ""


def _drop_output() -> None:
    """Let what is left of the output go nowhere, if it cannot be written.

    Python flushes again at exit, which would report it a second time.
    """
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """Let a request to terminate and a closed terminal end the block as Ctrl-C does.

    By default they end the process at once, which leaves temporary files and child processes. A
    signal that is ignored (``nohup``) or that has a handler is left alone.
    """

    def end(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    numbers = [signal.SIGTERM, signal.SIGHUP]
    if threading.current_thread() is not threading.main_thread():  # others cannot set handlers
        numbers = []
    set_here = [number for number in numbers if signal.getsignal(number) == signal.SIG_DFL]
    for number in set_here:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in set_here:
            signal.signal(number, signal.SIG_DFL)


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
