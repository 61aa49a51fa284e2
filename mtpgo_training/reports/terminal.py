# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The results of an evaluation as text for the terminal."""

from __future__ import annotations

from typing import Any

from mtpgo_training.evaluation.bags.bag_evaluation import BagResult
from mtpgo_training.evaluation.scores.score_summary import averages_table
from mtpgo_training.reports.honesty.honesty_tables import (
    comparison_table,
    headline_table,
    paths_table,
    weights_table,
)
from mtpgo_training.reports.honesty.live_scores import calibration_effect_table, live_table
from mtpgo_training.reports.tables import (
    HEADINGS,
    INTERVAL_KEYS,
    interval_table,
    manoeuvre_table,
    nees_table,
    span_text,
)
from mtpgo_training.table_format import to_text

Json = dict[str, Any]


def print_result(content: Json, result: BagResult) -> None:
    """Print the tables, the results over seeds and the agreement with bags.

    Args:
        content: of the evaluation.
        result: what the content was made of.
    """
    for protocol, heading in HEADINGS.items():
        if any(protocol in scores for scores in content["models"].values()):
            print(f"{heading}:\n{to_text(averages_table(content['models'], protocol))}\n")
            if not content["notes"]:
                print(f"{to_text(interval_table(content, protocol))}\n")
    for table in (
        headline_table(content),
        weights_table(content),
        paths_table(content),
        comparison_table(content),
    ):
        if table is not None:
            print(f"{to_text(table)}\n")
    if any("all" in found for found in content["by_manoeuvre"].values()):
        print(f"{to_text(manoeuvre_table(content))}\n\n{to_text(nees_table(content))}\n")
    for bag, rows in result.live.items():
        live = live_table(rows)
        if live is not None:
            print(f"{bag}:\n{to_text(live)}\n")
    effect = calibration_effect_table(content.get("calibration_effect", {}))
    if effect is not None:
        print(f"{to_text(effect)}\n")
    for group, row in content["seeds"].items():
        print(seeds_text(group, row))
    for bag, found in result.agreements.items():
        for model, agreement in found.items():
            print(agreement.text(bag, model))
    for note in content["notes"]:
        print(f"Note: {note}.")


def seeds_text(group: str, row: Json) -> str:
    """Return mean and interval over the seeds of one recipe, a line for each protocol."""
    lines = []
    for protocol in HEADINGS:
        if protocol in row:
            parts = [
                f"{key} {v['mean']:.3f} ({span_text(v['low'], v['high'])})"
                for key, v in row[protocol].items()
                if key in INTERVAL_KEYS
            ]
            lines.append(f"{group}, {len(row['models'])} seeds, {protocol}: {', '.join(parts)}")
    return "\n".join(lines)
