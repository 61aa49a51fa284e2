# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A table of text, and its formats for the terminal, Markdown and HTML."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Cell:
    """One value.

    Attributes:
        text: the value.
        interval: in which it lies, if that is known.
        best: the value is the best of its column.
    """

    text: str
    interval: str = ""
    best: bool = False

    def __str__(self) -> str:
        return f"{self.text} ({self.interval})" if self.interval else self.text


@dataclass(frozen=True)
class Row:
    """One line.

    Attributes:
        name: its first cell.
        cells: the others; text alone, where there is nothing more to say of it.
        colour: of a dot before the name in HTML.
        baseline: shown less prominently in HTML.
    """

    name: str
    cells: Sequence[Cell | str]
    colour: str | None = None
    baseline: bool = False


@dataclass(frozen=True)
class Table:
    """Rows under heads, of which the first is that of the names.

    Attributes:
        heads: titles of the columns.
        rows: the lines.
        heading: over the table, where it is shown on a page.
        text: a sentence below the heading.
    """

    heads: Sequence[str]
    rows: Sequence[Row]
    heading: str = ""
    text: str = ""


def to_text(table: Table) -> str:
    """Return a table for the terminal: names to the left, other columns to the right."""
    lines = _plain(table)
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join([name.ljust(widths[0]), *map(str.rjust, rest, widths[1:])])
        for name, *rest in lines
    )


def to_markdown(table: Table, rule: str = "---") -> str:
    """Return a table in Markdown.

    Args:
        table: the table.
        rule: below each head; ``---:`` aligns its column to the right.
    """
    heads, *rows = _plain(table)
    return "\n".join(f"| {' | '.join(line)} |" for line in (heads, [rule] * len(heads), *rows))


def to_html(table: Table) -> str:
    """Return a ``<table>``, whose classes are those of the style sheet of the report."""
    heads = "".join(f"<th>{html.escape(head)}</th>" for head in table.heads)
    rows = "\n".join(_html_row(row) for row in table.rows)
    return f"<table>\n<thead><tr>{heads}</tr></thead>\n<tbody>{rows}</tbody></table>"


def _plain(table: Table) -> list[list[str]]:
    return [[*table.heads], *([row.name, *map(str, row.cells)] for row in table.rows)]


def _html_row(row: Row) -> str:
    kind = ' class="baseline"' if row.baseline else ""
    dot = f'<span class="dot" style="background:{row.colour}"></span>' if row.colour else ""
    cells = "".join(map(_html_cell, row.cells))
    return f"<tr{kind}>\n<td>{dot}{html.escape(row.name)}</td>\n{cells}\n</tr>"


def _html_cell(cell: Cell | str) -> str:
    if isinstance(cell, str):
        return f"<td>{html.escape(cell)}</td>"
    kind = ' class="best"' if cell.best else ""
    interval = f'<span class="span">{html.escape(cell.interval)}</span>' if cell.interval else ""
    return f"<td{kind}>{html.escape(cell.text)}{interval}</td>"
