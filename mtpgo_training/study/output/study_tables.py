# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tables of a study beside the paper's figures: for the terminal, Markdown, LaTeX and CSV."""

from __future__ import annotations

import csv
import io
from typing import Any

from mtpgo_training.study.paper_tables import PaperValue
from mtpgo_training.study.study_results import half_width
from mtpgo_training.table_format import Cell, Row, Table

Json = dict[str, Any]

COLUMN_TITLES = {
    "ade": "ADE m",
    "fde": "FDE m",
    "mr": "MR",
    "apde": "APDE m",
    "anll": "ANLL",
    "fnll": "FNLL",
}
"""Heads by value."""

KERNEL_TITLES = {"anll": "ANLL by kernels", "fnll": "FNLL by kernels"}
"""Heads of the likelihoods by kernel density estimates."""

MISSING = "-"
"""Where there is no value."""

GAP = "gap"
"""Where a row could not be made at all."""


def title_of(column: str) -> str:
    """Return the head of a column."""
    kind, _, value = column.rpartition(".")
    return f"{kind}s {COLUMN_TITLES[value]}" if kind else COLUMN_TITLES[value]


def value_cell(value: Json | None, best: bool = False) -> Cell:
    """Return mean and half width of an interval."""
    if value is None:
        return Cell(MISSING)
    half = half_width(value)
    return Cell(
        _number(value["mean"]) + ("" if half is None else f" ± {_number(half)}"), best=best
    )


def paper_text(row: Json, column: str) -> str:
    """Return the paper's figure, in italics where it is by kernels."""
    value = row["paper"].get(column)
    if value is None:
        return MISSING
    text = str(PaperValue(**value))
    return f"({text})" if row["paper_by_kernels"] and column in KERNEL_TITLES else text


def main_table(content: Json) -> Table:
    """Return the paper's table: ours and the paper's figure side by side.

    Args:
        content: see :func:`mtpgo_training.study.study_results.results`.
    """
    best = _best(content)
    heads = [""]
    for column in content["columns"]:
        heads += [title_of(column), "paper"]
    rows = []
    for row in content["rows"]:
        cells: list[Cell | str] = []
        for column in content["columns"]:
            value = row["values"][column]
            empty = GAP if row["gap"] and not any(row["values"].values()) else MISSING
            cells.append(
                Cell(empty) if value is None else value_cell(value, row["name"] in best[column])
            )
            cells.append(paper_text(row, column))
        cells.append(str(len(row["seeds"])) if row["trained"] else MISSING)
        rows.append(Row(row["title"], cells, baseline=not row["trained"]))
    return Table([*heads, "seeds"], rows)


def kernel_table(content: Json) -> Table | None:
    """Return likelihoods by kernels beside the analytic ones, None if there are none."""
    rows = []
    for row in content["rows"]:
        if not any(row["kernels"].values()):
            continue
        cells = [value_cell(row["values"][key]) for key in KERNEL_TITLES]
        cells += [value_cell(row["kernels"][key]) for key in KERNEL_TITLES]
        rows.append(Row(row["title"], cells))
    if not rows:
        return None
    analytic = [COLUMN_TITLES[key] for key in KERNEL_TITLES]
    return Table(["", *analytic, *KERNEL_TITLES.values()], rows)


def ranking_table(content: Json, column: str) -> Table:
    """Return the rows by rank in a column, with their intervals."""
    rows = []
    for rank, row in enumerate(content["rankings"][column], 1):
        beats = {True: "yes", False: "no", None: MISSING}[row["beats_cv"]]
        apart = {True: "yes", False: "no", None: MISSING}[row["apart"]]
        cells: list[Cell | str] = [
            value_cell(row["value"]),
            apart,
            value_cell(row["cv"]),
            beats,
        ]
        rows.append(Row(f"{rank}. {row['title']}", cells))
    heads = ["", title_of(column), "interval apart from the row above", "CV", "better than CV"]
    return Table(heads, rows)


def training_table(content: Json) -> Table:
    """Return what the runs cost: means over the seeds."""
    rows = []
    for row in content["rows"]:
        runs = row["training"]
        if not runs:
            continue

        def mean(key: str, runs: list[Json] = runs) -> float:
            return sum(float(one[key]) for one in runs) / len(runs)

        cells = [
            str(int(mean("parameters"))),
            f"{mean('epochs_done'):.0f} of {mean('epochs'):.0f}",
            f"{mean('steps'):.0f}",
            f"{mean('minutes'):.1f}",
            f"{mean('steps_per_second'):.2f}",
        ]
        rows.append(Row(row["title"], cells))
    return Table(["", "parameters", "epochs", "steps", "min", "steps a second"], rows)


def gaps(content: Json) -> list[str]:
    """Return a sentence for each row that is not complete."""
    return [f"{row['title']}: {row['gap']}" for row in content["rows"] if row["gap"]]


def to_latex(content: Json, caption: str) -> str:
    """Return the paper's table in LaTeX (package booktabs), the paper's figures in brackets below.

    Args:
        content: see :func:`mtpgo_training.study.study_results.results`.
        caption: of the table.
    """
    best = _best(content)
    columns = content["columns"]
    heads = " & ".join(_escaped(title_of(column)) for column in columns)
    lines = [
        "% needs \\usepackage{booktabs}; below each row, in brackets: the figures of the paper",
        "\\begin{table}",
        f"\\caption{{{_escaped(caption)}}}",
        f"\\begin{{tabular}}{{l{'c' * len(columns)}}}",
        "\\toprule",
        f"Model & {heads} \\\\",
        "\\midrule",
    ]
    for row in content["rows"]:
        own = [_latex_value(row["values"][c], row["name"] in best[c]) for c in columns]
        lines.append(f"{_escaped(row['title'])} & {' & '.join(own)} \\\\")
        theirs = [_latex_paper(row, column) for column in columns]
        lines.append(f"\\quad (paper) & {' & '.join(theirs)} \\\\")
    lines += ["\\bottomrule", "\\end{tabular}", "\\end{table}"]
    lines += [f"% gap: {' '.join(text.split())}" for text in gaps(content)]
    return "\n".join(lines) + "\n"


def to_csv(content: Json) -> str:
    """Return a line for each row and column: ours with its interval, the paper's, and gaps."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(
        (
            "study",
            "data_set",
            "row",
            "value",
            "seeds",
            "mean",
            "low",
            "high",
            "paper",
            "paper_half_width",
            "gap",
        )
    )
    for row in content["rows"]:
        for column in content["columns"]:
            value = row["values"][column] or {}
            paper = row["paper"].get(column, {})
            writer.writerow(
                (
                    content["study"],
                    content["data_set"],
                    row["name"],
                    column,
                    value.get("seeds", 0),
                    value.get("mean"),
                    value.get("low"),
                    value.get("high"),
                    paper.get("value"),
                    paper.get("half_width"),
                    row["gap"],
                )
            )
    return text.getvalue()


def _best(content: Json) -> dict[str, set[str]]:
    """Return by column the names of the rows with the smallest mean."""
    found: dict[str, set[str]] = {}
    for column in content["columns"]:
        means = {
            row["name"]: row["values"][column]["mean"]
            for row in content["rows"]
            if row["values"][column] is not None
        }
        found[column] = {name for name, mean in means.items() if mean == min(means.values())}
    return found


def _number(value: float) -> str:
    return f"{value:.3f}" if abs(value) < 100.0 else f"{value:.1f}"


def _latex_value(value: Json | None, best: bool) -> str:
    if value is None:
        return "---"
    half = half_width(value)
    text = _number(value["mean"]) + ("" if half is None else f" \\pm {_number(half)}")
    return f"$\\mathbf{{{text}}}$" if best else f"${text}$"


def _latex_paper(row: Json, column: str) -> str:
    text = paper_text(row, column).strip("()").replace("±", "\\pm")
    if text == MISSING:
        return "---"
    by_kernels = row["paper_by_kernels"] and column in KERNEL_TITLES
    return f"(\\textit{{{text}}})" if by_kernels else f"(${text}$)"


def _escaped(text: str) -> str:
    for sign in "&%$#_":
        text = text.replace(sign, f"\\{sign}")
    return text
