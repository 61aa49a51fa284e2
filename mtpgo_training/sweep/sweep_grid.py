# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The grid of a sweep: values for keys of the configuration, and all of their combinations."""

from __future__ import annotations

import hashlib
import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.yaml_file import dump_yaml, parse_yaml

SEED = "seed"
"""Key over which the table has means."""

MOST_RUNS = 10_000
"""Most combinations; chosen: more are a slip, such as a range with two digits too many."""

_RANGE = re.compile(r"(-?\d+)\.\.(-?\d+)(?:\.\.(\d+))?")

_LONGEST_NAME = 120
"""Longest name of a folder (characters); chosen: file systems allow 255 bytes."""


@dataclass(frozen=True)
class GridPoint:
    """One combination of values.

    Attributes:
        settings: key of the configuration and value, as given with ``--set``, without the seed.
        seed: of the training.
    """

    settings: tuple[tuple[str, str], ...]
    seed: int

    @property
    def name(self) -> str:
        """Name of the run, which is also that of its folder."""
        whole = ",".join([*(f"{k}={v}" for k, v in self.settings), f"{SEED}={self.seed}"])
        safe = re.sub(r"[^\w.,=+-]+", "_", whole)
        if safe == whole and len(safe) <= _LONGEST_NAME:
            return safe
        digest = hashlib.sha256(whole.encode()).hexdigest()[:8]
        return f"{safe[: _LONGEST_NAME - 9]}-{digest}"

    def overrides(self) -> list[str]:
        """Return the values as ``KEY=VALUE``."""
        return [f"{key}={value}" for key, value in (*self.settings, (SEED, str(self.seed)))]


def setting_text(settings: Mapping[str, str]) -> str:
    """Return the values of a combination in words, empty if only the seed is swept."""
    return " ".join(f"{key}={value}" for key, value in settings.items())


def grid_points(words: Sequence[str], seed: int) -> list[GridPoint]:
    """Return all combinations, the seeds of a combination one after the other.

    Args:
        words: ``KEY=VALUE,VALUE`` each, with values in YAML or integers ``FIRST..LAST`` (or
            ``FIRST..LAST..STEP``), both ends included.
        seed: of all runs, if the words give none.

    Raises:
        ConfigurationError: a word is none of these, or a key or value is given twice.
    """
    given: dict[str, list[str]] = {}
    for word in words:
        key, _, text = word.partition("=")
        values = _values(text)
        if not key or not values:
            raise ConfigurationError(
                f"--sweep is given {word!r}, expected KEY=VALUE,VALUE or KEY=FIRST..LAST"
            )
        if key in given:
            raise ConfigurationError(f"--sweep names {key} twice, expected all values in one list")
        twice = next((value for value in values if values.count(value) > 1), None)
        if twice is not None:
            raise ConfigurationError(f"--sweep gives {key} the value {twice} twice")
        given[key] = values
    seeds = given.pop(SEED, [str(seed)])
    for text in seeds:
        if not re.fullmatch(r"-?\d+", text):
            raise ConfigurationError(f"--sweep gives {SEED} the value {text}, expected integers")
    count = len(seeds)
    for values in given.values():
        count *= len(values)
    if count > MOST_RUNS:
        raise ConfigurationError(f"--sweep asks for {count} runs, expected at most {MOST_RUNS}")
    pairs = [[(key, value) for value in values] for key, values in given.items()]
    return [
        GridPoint(settings, int(one)) for settings in itertools.product(*pairs) for one in seeds
    ]


def swept_keys(words: Sequence[str]) -> list[str]:
    """Return the keys of a sweep."""
    return [word.partition("=")[0] for word in words]


def _values(text: str) -> list[str]:
    """Return the values of a list as YAML texts, empty if it is none."""
    try:
        items = parse_yaml(f"[{text}]")
    except Exception:  # a value that is not of its tag fails PyYAML in many ways
        return []
    found: list[str] = []
    for item in items:
        match = _RANGE.fullmatch(item) if isinstance(item, str) else None
        if match is None:
            found.append(dump_yaml(item, one_line=True))
            continue
        first, last, step = int(match[1]), int(match[2]), int(match[3] or 1)
        if step < 1 or (last - first) / step > MOST_RUNS:
            return []
        found += [str(value) for value in range(first, last + 1, step)]
    return found
