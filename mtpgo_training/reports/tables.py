# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tables of an evaluation, from the content of ``mtpgo evaluate --json``."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from mtpgo_training.evaluation.scores.score_summary import TITLES, titles_of, value_text
from mtpgo_training.reports.series import PROTOCOL, colour, series_names
from mtpgo_training.table_format import Cell, Row, Table

Json = dict[str, Any]

HEADINGS = {"all": "all agents", "centre": "each agent in the centre of its graph"}
"""Names of the protocols, in the order in which they are shown."""

INTERVAL_KEYS = ("ade", "fde", "anll", "coverage_90_moving_5s")
"""The values that are given with their interval where there is no room for all."""

NEES_SHARES = (0.2, 0.6, 1.0)
"""The parts of the horizon at whose ends the NEES is printed."""

_LOWER_IS_BETTER = ("ade", "fde", "mr", "apde", "anll", "fnll", "min_ade", "min_fde")
_GROUP_KEYS = ("ade", "fde", "mr", "anll")

_TEXTS = {
    "all": "Every road user once an instant, in the graph that the node would predict it in.",
    "centre": "Every road user in the graph of which it is the centre, as the paper evaluates.",
}
_GROUP_TEXTS = {
    "by_manoeuvre": (
        "By manoeuvre",
        "Only road users that were observed for the whole horizon; docs/evaluation.md has the "
        "rules.",
    ),
    "by_class": ("By class", "As the recordings name them."),
    "by_since_start": (
        "By time since the recording's start",
        "Models with trails know what earlier road users have shown them of the site.",
    ),
    "by_recording": ("By recording", ""),
}


def score_cells(
    content: Json,
    model: str,
    protocol: str,
    digits: int,
    with_interval: Collection[str],
    keys: Collection[str] = TITLES,
) -> list[Cell]:
    """Return the averages of a model, a column for each of the keys.

    Args:
        content: of the evaluation.
        model: its name.
        protocol: ``all`` or ``centre``.
        digits: after the point.
        with_interval: the values that are given with their interval over recordings.
        keys: names of the values.
    """
    scores = content["models"][model][protocol]
    intervals = content["intervals"].get(model, {}).get(protocol, {})
    others = [p[protocol] for p in content["models"].values() if protocol in p]
    return [
        Cell(
            value_text(scores.get(key), digits),
            interval_text(intervals.get(key)) if key in with_interval else "",
            best=key in _LOWER_IS_BETTER and _is_least(scores[key], [row[key] for row in others]),
        )
        for key in keys
    ]


def result_tables(content: Json) -> list[Table]:
    """Return the main table of each protocol with all intervals, and those over seeds."""
    tables, titles = [], titles_of(content["models"])
    for protocol, heading in HEADINGS.items():
        rows = [
            Row(
                name,
                [
                    *score_cells(content, name, protocol, 3, titles, titles),
                    _relative_cell(content, name, protocol),
                ],
                colour(content, name) if protocol == PROTOCOL else None,
                name in content["baselines"],
            )
            for name, protocols in content["models"].items()
            if protocol in protocols
        ]
        heads = ["", *titles.values(), "ADE / cv"]
        if rows:
            tables.append(Table(heads, rows, f"Results: {heading}", _TEXTS[protocol]))
    return tables + [_seeds_table(group, row) for group, row in content["seeds"].items()]


def group_tables(content: Json) -> list[Table]:
    """Return the results by manoeuvre, by class and by recording, of all agents."""
    tables = []
    names = series_names(content)
    shown = [name for name in names if name not in ("ca", "ctrv")]
    for key, (heading, text) in _GROUP_TEXTS.items():
        found = {name: content[key][name].get(PROTOCOL, {}) for name in names}
        groups = list(dict.fromkeys(group for scores in found.values() for group in scores))
        rows = [
            Row(
                f"{group if key == 'by_recording' else group.replace('_', ' ')}: {name}",
                [value_text(found[name][group][k], 2) for k in (*_GROUP_KEYS, "n")],
                colour(content, name),
                name in content["baselines"],
            )
            for group in groups
            for name in shown
            if group in found[name]
        ]
        heads = ["", *(TITLES[k] for k in (*_GROUP_KEYS, "n"))]
        if rows and (key != "by_recording" or len(groups) > 1):
            tables.append(Table(heads, rows, heading, text))
    return tables


def agreement_table(content: Json) -> Table | None:
    """Return the differences of recorded and offline predictions, None without any."""
    rows = [
        Row(
            f"{bag} and {model}",
            [
                *(value_text(row[k]) for k in ("largest_mm", "median_mm")),
                *(str(row[k]) for k in ("predictions", "unpaired")),
                row["where"] or "-",
            ],
        )
        for bag, found in content["agreement"].items()
        for model, row in found.items()
    ]
    heads = ["", "largest mm", "median mm", "compared", "not in both", "largest of"]
    return Table(heads, rows) if rows else None


def interval_table(content: Json, protocol: str) -> Table:
    """Return the intervals over recordings of the most important values."""
    rows = []
    for model, protocols in content["intervals"].items():
        if protocol in protocols:
            ends = [protocols[protocol].get(key, (None, None)) for key in INTERVAL_KEYS]
            relative = content["relative"][model].get(protocol, {}).get("ade", {})
            ends.append((relative.get("low"), relative.get("high")))
            rows.append(Row(model, [span_text(*end) for end in ends]))
    heads = ["95 % interval", *(TITLES[key] for key in INTERVAL_KEYS), "ADE / cv"]
    return Table(heads, rows)


def manoeuvre_table(content: Json) -> Table:
    """Return the ADE by manoeuvre of all agents that were observed for the whole horizon."""
    found = {m: p[PROTOCOL] for m, p in content["by_manoeuvre"].items() if PROTOCOL in p}
    names = list(dict.fromkeys(name for rows in found.values() for name in rows))
    counts = {name: max(r[name]["n"] for r in found.values() if name in r) for name in names}
    heads = ["ADE m", *(f"{name.replace('_', ' ')} ({counts[name]})" for name in names)]
    rows = [
        Row(model, [value_text(r[name]["ade"]) if name in r else "-" for name in names])
        for model, r in found.items()
    ]
    return Table(heads, rows)


def nees_table(content: Json) -> Table:
    """Return the NEES of all agents at a few times, of the heaviest mode and of the mixture."""
    found = {m: p[PROTOCOL] for m, p in content["by_horizon"].items() if PROTOCOL in p}
    found = {m: row for m, row in found.items() if any(v is not None for v in row["nees"])}
    steps = max((len(row["nees"]) for row in found.values()), default=0)
    shown = sorted({max(0, round(steps * s) - 1) for s in NEES_SHARES}) if steps else []
    times: list[float | None] = max((row["time_s"] for row in found.values()), key=len, default=[])
    heads = [f"step {k + 1}" if times[k] is None else f"{times[k]:g} s" for k in shown]
    rows = []
    for model, row in found.items():
        pairs = zip(row["nees"], row["nees_mixture"], strict=True)
        cells = ["-" if a is None or b is None else f"{a:.2f} ({b:.2f})" for a, b in pairs]
        rows.append(Row(model, [cells[k] if k < len(cells) else "-" for k in shown]))
    return Table(["NEES (mixture), 2 is right", *heads], rows)


def _seeds_table(group: str, row: Json) -> Table:
    keys = [key for key in TITLES if key != "n"]
    rows = []
    for protocol, heading in HEADINGS.items():
        if protocol in row:
            given = [row[protocol].get(key) for key in keys]
            rows.append(
                Row(
                    heading,
                    [
                        Cell(value_text(v["mean"]), interval_text((v["low"], v["high"])))
                        if v
                        else "-"
                        for v in given
                    ],
                )
            )
    return Table(
        ["", *(TITLES[key] for key in keys)],
        rows,
        f"Over seeds: {group}",
        f"Mean over {', '.join(row['models'])}, and the 95 % interval of that mean (Student's t): "
        "what training again with another seed would give.",
    )


def _is_least(value: float | None, values: Sequence[float | None]) -> bool:
    return value is not None and value == min(v for v in values if v is not None)


def _relative_cell(content: Json, name: str, protocol: str) -> Cell:
    relative = content["relative"][name][protocol].get("ade")
    if relative is None:
        return Cell("-")
    ends = None if name == "cv" else (relative["low"], relative["high"])
    return Cell(value_text(relative["value"], 2), interval_text(ends))


def interval_text(ends: Sequence[float | None] | None) -> str:
    """Return an interval as it is shown next to its value, empty where there is none."""
    low, high = ends or (None, None)
    return "" if low is None or high is None else f"{low:.2f} to {high:.2f}"


def span_text(low: float | None, high: float | None) -> str:
    """Return an interval as it is shown alone."""
    return "-" if low is None or high is None else f"{low:.3f}..{high:.3f}"
