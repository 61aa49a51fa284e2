# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Results as a table in Markdown, as it is pasted into a model card."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import read_json
from mtpgo_training.evaluation.scores.score_summary import titles_of
from mtpgo_training.reports.tables import HEADINGS, INTERVAL_KEYS, score_cells
from mtpgo_training.table_format import Row, Table, to_markdown

Json = dict[str, Any]


def read_results(path: Path) -> Json:
    """Return what ``mtpgo evaluate --json`` wrote.

    Raises:
        ConfigurationError: the file cannot be read or holds something else.
    """
    kind, keys = "a file of 'mtpgo evaluate --json'", ("models", "intervals", "recordings")
    content = read_json(path, kind, keys, otherwise="holds no results")
    try:
        markdown_table([("", content)])
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ConfigurationError(
            f"{path} holds no results that can be shown, expected {kind} of this version"
        ) from error
    return content


def markdown_table(results: Sequence[tuple[str, Json]]) -> str:
    """Return one table of all results, a line for each model and protocol.

    Values with intervals over recordings are given as ``value (low to high)``.

    Args:
        results: name and content of each; there is no column of names if all are empty.
    """
    named = any(name for name, _ in results)
    titles = titles_of(*(content["models"] for _, content in results))
    heads = ["protocol", "model", *(title.replace("%", " %") for title in titles.values())]
    lines = [
        [name, protocol, model, *score_cells(content, model, protocol, 2, INTERVAL_KEYS, titles)]
        for name, content in results
        for protocol in HEADINGS
        for model, protocols in content["models"].items()
        if protocol in protocols
    ]
    rows = [Row(str(first), rest) for first, *rest in (line[not named :] for line in lines)]
    notes = [note for _, content in results for note in content.get("warnings", ())]
    text = to_markdown(Table(["data", *heads] if named else heads, rows))
    return "\n".join([text, "", *(f"- Note: {note}." for note in dict.fromkeys(notes))]).rstrip()
