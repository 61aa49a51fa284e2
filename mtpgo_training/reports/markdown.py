# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Results as a table in Markdown, so that the figures of a model card are made and not typed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mtpgo_core.errors import RecordingError
from mtpgo_training.evaluation.scorebook import TITLES

Json = dict[str, Any]

_PROTOCOLS = ("all", "centre")
_WITH_INTERVAL = ("ade", "fde", "anll", "coverage_90")


def read_results(path: Path) -> Json:
    """What ``mtpgo evaluate --json`` wrote.

    Raises:
        RecordingError: it is missing or something else.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise RecordingError(f"{path} is no JSON: {error}") from error
    if not isinstance(content, dict) or not {"models", "intervals", "recordings"} <= set(content):
        raise RecordingError(
            f"{path} holds no results, expected a file of 'mtpgo evaluate --json'"
        )
    return content


def markdown_table(results: Sequence[tuple[str, Json]]) -> str:
    """One table of all results, a line for each model and protocol.

    Values with intervals over recordings stand as ``value (low to high)``.

    Args:
        results: what each is called, which is left out where it is empty, and its content.
    """
    named = any(name for name, _ in results)
    heads = [*(["data"] if named else []), "protocol", "model", *_titles()]
    lines = [_line(heads), _line(["---"] * len(heads))]
    for name, content in results:
        for protocol in _PROTOCOLS:
            for model, protocols in content["models"].items():
                if protocol in protocols:
                    cells = [*([name] if named else []), protocol, model]
                    lines.append(_line([*cells, *_cells(content, model, protocol)]))
    notes = [note for _, content in results for note in content.get("warnings", ())]
    lines += ["", *(f"- Note: {note}." for note in dict.fromkeys(notes))]
    return "\n".join(lines).rstrip()


def _titles() -> list[str]:
    return [title.replace("%", " %") for title in TITLES.values()]


def _cells(content: Json, model: str, protocol: str) -> list[str]:
    scores = content["models"][model][protocol]
    intervals = content["intervals"].get(model, {}).get(protocol, {})
    cells = []
    for key in TITLES:
        value = scores[key]
        if key == "n":
            cells.append(str(value))
        elif value is None:
            cells.append("-")
        else:
            low, high = intervals.get(key, (None, None))
            span = key in _WITH_INTERVAL and low is not None
            cells.append(f"{value:.2f}" + (f" ({low:.2f} to {high:.2f})" if span else ""))
    return cells


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
