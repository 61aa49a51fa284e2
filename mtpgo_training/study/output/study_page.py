# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page of a study: one HTML file with the tables and the learning curves in it."""

from __future__ import annotations

import html
from pathlib import Path
from typing import Any

from mtpgo_training.atomic_files import write_text
from mtpgo_training.study.output.study_figures import (
    as_image,
    extrapolation_curves,
    learning_curves,
)
from mtpgo_training.study.output.study_output import heading, sections
from mtpgo_training.study.output.study_tables import gaps
from mtpgo_training.study.study_folder import StudyFolder
from mtpgo_training.table_format import to_html

Json = dict[str, Any]

_STYLE = """
body { font: 15px/1.5 system-ui, "DejaVu Sans", sans-serif; max-width: 1240px; margin: 2em auto;
  padding: 0 20px; color: #22272c; }
table { border-collapse: collapse; font-size: 12.5px; font-variant-numeric: tabular-nums; }
th, td { padding: 5px 8px; text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
thead th { border-bottom: 1px solid #e1e4e7; color: #5d6872; }
tr.baseline td { color: #5d6872; }
td.best { font-weight: 700; }
img { max-width: 100%; }
"""

_CURVES = (
    "Error on the validation recordings over the time of training, a line for each seed; the "
    "dotted line is constant velocity."
)
_BEYOND = (
    "Mean distance from the truth at each time ahead, a line for each seed; to the right of the "
    "dashed line the networks predict for longer than they were trained."
)


def write_page(folder: StudyFolder, content: Json) -> Path:
    """Write ``index.html`` and return its path.

    Args:
        folder: of the study.
        content: see :func:`mtpgo_training.study.study_results.results`.
    """
    title = html.escape(heading(content))
    parts = [f"<h1>{title}</h1>"]
    for table in sections(content):
        if table.heading:
            parts.append(f"<h2>{html.escape(table.heading)}</h2>")
        parts += [f"<p>{html.escape(table.text)}</p>", to_html(table)]
    missing = [*gaps(content), *_not_extrapolated(content)]
    if missing:
        items = "".join(f"<li>{html.escape(text)}</li>" for text in missing)
        parts.append(f"<h2>Gaps</h2><ul>{items}</ul>")
    figures = (
        ("Learning curves", _CURVES, learning_curves(folder, content)),
        ("Beyond the horizon", _BEYOND, extrapolation_curves(content)),
    )
    for name, text, png in figures:
        if png is not None:
            parts.append(f"<h2>{name}</h2><p>{text}</p>{as_image(png, name)}")
    page = folder.path / "index.html"
    body = "\n".join(parts)
    write_text(
        page,
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>\n'
        f"<style>{_STYLE}</style></head>\n<body>{body}</body></html>\n",
    )
    return page


def _not_extrapolated(content: Json) -> list[str]:
    """Return why rows have no error beyond the horizon."""
    return [
        f"{row['title']}, longer horizon: {one['gap']}"
        for row in content["rows"]
        for one in row["extrapolation"][:1]
        if "gap" in one
    ]
