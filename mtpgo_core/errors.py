# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The exceptions for bad input.

Every message is one sentence that says what was given, where, and what was expected. Command-line
programs print it on stderr and exit with status 2; the node logs it, counts it and continues.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence


class MtpgoError(Exception):
    """Bad input from outside: a file, a message, a parameter or an argument."""


class ModelFileError(MtpgoError):
    """A model file that is missing, truncated, not TorchScript or without a usable task."""


class MessageError(MtpgoError):
    """A message that cannot be turned into tracked states, or a package that is not installed."""


class FrameError(MtpgoError):
    """A coordinate frame that changes within a stream or has no transform to the fixed frame."""


class RecordingError(MtpgoError):
    """A recording (CSV, bag) that cannot be read or written."""


class ConfigurationError(MtpgoError):
    """A parameter or configuration value that is not allowed."""


def found_names(
    names: Sequence[str], most: int = 100, longest: int = 256, none: str = "none"
) -> str:
    """Return names that were found in a file or a message as part of one line.

    Args:
        names: any texts; those that are not printable are quoted, with escapes.
        most: number of names that are shown; the others are counted.
        longest: number of characters that are shown of each.
        none: text for no names.
    """
    first = [name if len(name) <= longest else name[:longest] + "..." for name in names[:most]]
    shown = [name if name.isprintable() and name else repr(name) for name in first]
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(shown) + more or none


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return the end of a sentence about an unknown name: the nearest known one, empty if none is.

    Args:
        name: what was given.
        names: the known ones.
    """
    near = difflib.get_close_matches(name, list(names), n=1)
    return f", did you mean {near[0]}?" if near else ""


def reason_of(error: BaseException) -> str:
    """Return the message of an exception of the system or a library, else its type."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return " ".join(str(error).split()).rstrip(".") or type(error).__name__
