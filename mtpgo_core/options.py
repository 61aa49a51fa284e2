# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options of configuration dataclasses: declared with their limits, checked with one wording.

A field that is declared with :func:`option` carries its limits; ``__post_init__`` of the dataclass
calls :func:`check_options`. Every error reads ``NAME is VALUE, expected WHAT``. Only the standard
library is imported here, so that the networks, the node and the training package can share it.
"""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from mtpgo_core.errors import ConfigurationError

T = typing.TypeVar("T")

LARGEST_SEED = 10**9
"""Largest seed; chosen: random numbers of an epoch and batch follow from its product with primes,
which has to fit into 64 bits, and SUMO's own seed has 32."""

LARGEST_THREADS = 1024
"""Most threads of torch; chosen, above the cores of any machine: each is started at once."""


@dataclass(frozen=True)
class Limits:
    """The values that an option may have.

    Attributes:
        low, high: smallest and largest value. NaN is never allowed where there is a limit.
        above, below: the value must be more, or less, than this.
        choices: the only values, any where empty.
    """

    low: float | None = None
    high: float | None = None
    above: float | None = None
    below: float | None = None
    choices: tuple[Any, ...] = ()

    def allow(self, value: Any) -> bool:
        """Whether the value is allowed."""
        return (
            (not self.choices or value in self.choices)
            and (self.low is None or value >= self.low)
            and (self.high is None or value <= self.high)
            and (self.above is None or value > self.above)
            and (self.below is None or value < self.below)
        )

    def __str__(self) -> str:
        if self.choices:
            return f"one of {listed(self.choices)}"
        if self.below == math.inf:
            return f"{dataclasses.replace(self, below=None)} and finite"
        least = f"{self.low:g}" if self.low is not None else f"more than {self.above:g}"
        if self.high is not None:
            return f"{least} to {self.high:g}"
        if self.below is not None:
            return f"{least} to less than {self.below:g}"
        return least if self.low is None else f"at least {least}"


def option(
    default: Any,
    *,
    low: float | None = None,
    high: float | None = None,
    above: float | None = None,
    below: float | None = None,
    choices: tuple[Any, ...] = (),
    **metadata: Any,
) -> Any:
    """Return a dataclass field with limits.

    Args:
        default: its default.
        low: see :class:`Limits`, like the next four. Of a tuple every item is checked; None is
            always allowed.
        high: largest value.
        above: exclusive lower limit.
        below: exclusive upper limit; ``math.inf`` asks for a finite value.
        choices: the only values.
        metadata: kept in the field's metadata.
    """
    limits = Limits(low, high, above, below, choices)
    return dataclasses.field(default=default, metadata={**metadata, "limits": limits})


def check_options(config: Any, prefix: str = "") -> None:
    """Check every field of a configuration dataclass that has limits.

    Args:
        config: an instance of the dataclass.
        prefix: put before the field's name in the error, for example ``"history."``.

    Raises:
        ConfigurationError: a value that is not allowed.
    """
    for field in dataclasses.fields(config):
        limits, value = field.metadata.get("limits"), getattr(config, field.name)
        if limits is None or value is None:
            continue
        for item in value if isinstance(value, tuple) else (value,):
            require(f"{prefix}{field.name}", item, limits.allow(item), limits)


def check_types(config: Any, prefix: str = "") -> None:
    """Check that every field of a configuration dataclass has a value of its type.

    Raises:
        ConfigurationError: a value of another type.
    """
    hints = typing.get_type_hints(type(config))
    for field in dataclasses.fields(config):
        _value(hints[field.name], getattr(config, field.name), f"{prefix}{field.name}")


def require(name: str, value: object, valid: bool, expected: object) -> None:
    """Raise the error of an option unless it is valid.

    Args:
        name: of the option, as its user writes it.
        value: what was given.
        valid: whether it is allowed.
        expected: the values that are allowed, in words.

    Raises:
        ConfigurationError: it is not valid.
    """
    if not valid:
        raise ConfigurationError(f"{name} is {value!r}, expected {expected}")


def listed(names: Iterable[Any]) -> str:
    """Names as text: quoted, separated by commas."""
    return ", ".join(repr(name) for name in names)


def is_unicode(text: str) -> bool:
    r"""Return whether a text can be written in UTF-8: JSON may hold lone surrogates (\ud800).

    Printing, storing or comparing such a text would fail much later.
    """
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def from_dict(cls: type[T], data: Any, where: str) -> T:
    """Return a configuration dataclass made of plain JSON or YAML data, checked field by field.

    Args:
        cls: the dataclass, possibly nested.
        data: what the file holds at this place.
        where: dotted name of the place, for the error.

    Raises:
        ConfigurationError: an unknown field, or a value that is not allowed or of another type.
    """
    if not isinstance(data, Mapping):
        raise ConfigurationError(f"{where} is {data!r}, expected a mapping of its fields")
    hints = typing.get_type_hints(cls)
    unknown = sorted(set(data) - set(hints))
    if unknown:
        raise ConfigurationError(
            f"{where} has the unknown field {unknown[0]!r}, expected {', '.join(hints)}"
        )
    return cls(**{k: _value(hints[k], v, f"{where}.{k}") for k, v in data.items()})


def _value(hint: Any, value: Any, where: str) -> Any:
    """Return ``value`` as the type ``hint``."""
    if dataclasses.is_dataclass(hint):
        return from_dict(typing.cast(type, hint), value, where)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is types.UnionType or origin is typing.Union:
        if value is None and type(None) in arguments:
            return None
        return _value(next(a for a in arguments if a is not type(None)), value, where)
    if origin is tuple:
        require(where, value, isinstance(value, list | tuple), "a list")
        same_length = arguments[-1] is Ellipsis or len(arguments) == len(value)
        require(where, value, same_length, f"{len(arguments)} values")
        return tuple(_value(arguments[0], v, f"{where}[{i}]") for i, v in enumerate(value))
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError:
            raise ConfigurationError(
                f"{where} is a whole number beyond all of floating point, expected a number"
            ) from None
    plain = origin or hint
    if plain in (bool, int, float, str, dict, list):
        fits = isinstance(value, plain) and (plain is bool or not isinstance(value, bool))
        require(where, value, fits, plain.__name__)
        if plain is str:
            require(where, value, is_unicode(value), "text without lone surrogates")
    return value
