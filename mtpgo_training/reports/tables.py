# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tables of the page, from the content of ``mtpgo evaluate --json``."""

from __future__ import annotations

from typing import Any

from mtpgo_training.evaluation.scorebook import TITLES
from mtpgo_training.evaluation.summary import HEADINGS
from mtpgo_training.reports.figures import PROTOCOL, colour, series_names

Json = dict[str, Any]

_LOWER_IS_BETTER = ("ade", "fde", "mr", "apde", "anll", "fnll", "min_ade", "min_fde")
_GROUP_KEYS = ("ade", "fde", "mr", "anll", "coverage_90")

_TEXTS = {
    "all": "Every road user once an instant, in the graph that the node would predict it in.",
    "centre": "Every road user in the graph of which it is the centre, as the paper evaluates.",
}


def result_tables(content: Json) -> list[Json]:
    """The main table of each protocol, and of the seeds if there are several."""
    tables = []
    for protocol, heading in HEADINGS.items():
        names = [n for n in content["models"] if protocol in content["models"][n]]
        if names:
            rows = [_row(content, name, protocol) for name in names]
            _mark_best(rows)
            tables.append(
                {
                    "heading": f"Results: {heading}",
                    "text": _TEXTS[protocol],
                    "heads": ["", *TITLES.values(), "ADE / cv"],
                    "rows": rows,
                }
            )
    return tables + [_seeds(group, row) for group, row in content["seeds"].items()]


def group_tables(content: Json) -> list[Json]:
    """Results by manoeuvre, by class and by recording, of all agents."""
    texts = {
        "by_manoeuvre": (
            "By manoeuvre",
            "Only road users that were observed for the whole horizon; docs/evaluation.md has the "
            "rules.",
        ),
        "by_class": ("By class", "As the recordings name them."),
        "by_recording": ("By recording", ""),
    }
    tables = []
    for key, (heading, text) in texts.items():
        names = series_names(content)
        groups = list(dict.fromkeys(g for n in names for g in content[key][n].get(PROTOCOL, {})))
        shown = [n for n in names if n not in ("ca", "ctrv")]
        rows = []
        for group in groups:
            for name in shown:
                scores = content[key][name].get(PROTOCOL, {}).get(group)
                if scores is not None:
                    label = group if key == "by_recording" else group.replace("_", " ")
                    rows.append(
                        {
                            "name": f"{label}: {name}",
                            "colour": colour(content, name),
                            "baseline": name in content["baselines"],
                            "cells": [
                                *({"text": _text(scores[k])} for k in _GROUP_KEYS),
                                {"text": str(scores["n"])},
                            ],
                        }
                    )
        if rows and (key != "by_recording" or len(groups) > 1):
            heads = ["", *(TITLES[k] for k in (*_GROUP_KEYS, "n"))]
            tables.append({"heading": heading, "text": text, "heads": heads, "rows": rows})
    return tables


def agreement_table(content: Json) -> Json | None:
    """How far recorded and offline predictions are apart, None where nothing was compared."""
    rows = []
    for bag, found in content["agreement"].items():
        for model, row in found.items():
            cells = [
                _text(row["largest_mm"], 3),
                _text(row["median_mm"], 3),
                _text(row["resolution_mm"], 3),
                str(row["predictions"]),
                str(row["unpaired"]),
                row["where"] or "-",
            ]
            rows.append({"name": f"{bag} and {model}", "cells": [{"text": c} for c in cells]})
    heads = ["", "largest mm", "median mm", "float32 mm", "compared", "not in both", "largest of"]
    return {"heads": heads, "rows": rows} if rows else None


def _row(content: Json, name: str, protocol: str) -> Json:
    scores = content["models"][name][protocol]
    intervals = content["intervals"][name][protocol]
    cells: list[Json] = []
    for key in TITLES:
        if key == "n":
            cells.append({"text": str(scores["n"])})
            continue
        low, high = intervals.get(key, (None, None))
        span = None if low is None else f"{low:.2f} to {high:.2f}"
        cells.append({"text": _text(scores[key], 3), "span": span, "key": key})
        cells[-1]["value"] = scores[key]
    share = content["relative"][name][protocol].get("ade")
    cells.append({"text": "-"} if share is None else {"text": f"{share['value']:.2f}"})
    if share is not None and share["low"] is not None and name != "cv":
        cells[-1]["span"] = f"{share['low']:.2f} to {share['high']:.2f}"
    return {
        "name": name,
        "colour": colour(content, name) if protocol == PROTOCOL else None,
        "baseline": name in content["baselines"],
        "cells": cells,
    }


def _mark_best(rows: list[Json]) -> None:
    for i in range(len(rows[0]["cells"])):
        column = [row["cells"][i] for row in rows]
        values = [c["value"] for c in column if c.get("value") is not None]
        if values and column[0].get("key") in _LOWER_IS_BETTER:
            for cell in column:
                cell["best"] = cell.get("value") == min(values)


def _seeds(group: str, row: Json) -> Json:
    rows = []
    keys = [key for key in TITLES if key != "n"]
    for protocol in HEADINGS:
        if protocol in row:
            cells = []
            for key in keys:
                value = row[protocol].get(key)
                cell: Json = {"text": "-" if value is None else f"{value['mean']:.3f}"}
                if value is not None and value["low"] is not None:
                    cell["span"] = f"{value['low']:.2f} to {value['high']:.2f}"
                cells.append(cell)
            rows.append({"name": HEADINGS[protocol], "cells": cells})
    return {
        "heading": f"Over seeds: {group}",
        "text": f"Mean over {', '.join(row['models'])}, and the 95 % interval of that mean "
        "(Student's t): what training again with another seed would give.",
        "heads": ["", *(TITLES[key] for key in keys)],
        "rows": rows,
    }


def _text(value: float | None, digits: int = 2) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
