# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Writes the results of a study: ``result`` as JSON, CSV, Markdown and LaTeX."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from mtpgo_training.atomic_files import write_text
from mtpgo_training.study.output.study_tables import (
    gaps,
    kernel_table,
    main_table,
    ranking_table,
    title_of,
    to_csv,
    to_latex,
    training_table,
)
from mtpgo_training.study.paper_tables import KERNEL_REMARK, PAPER_CAPTIONS
from mtpgo_training.study.study_rows import find_study
from mtpgo_training.table_format import Table, to_markdown

Json = dict[str, Any]


def heading(content: Json) -> str:
    """Return the title of the study's page."""
    return f"Study {content['study']}, beside the paper's figures for {content['data_set']}"


def explanation(content: Json) -> str:
    """Return what the table shows."""
    policy = find_study(content["study"]).policy
    who = "each road user as the centre of its graph" if policy else "all road users of a scene"
    return (
        f"Scored on the test recordings: {who}. Ours: mean over the seeds ± half of the 95 % "
        "interval by Student's t (none with one seed); columns 'paper': the figures of its "
        f"{PAPER_CAPTIONS[content['study']]}, which were measured on {content['data_set']}."
    )


def sections(content: Json) -> list[Table]:
    """Return all tables, each with its heading."""
    found = [("", explanation(content), main_table(content))]
    kernels = kernel_table(content)
    if kernels is not None:
        found.append(("Likelihoods by kernel density estimates", KERNEL_REMARK, kernels))
    for column in content["rankings"]:
        title = f"Ranking: {title_of(column)}"
        found.append((title, "By the mean, with its interval.", ranking_table(content, column)))
    found.append(("Trainings", "Means over the seeds.", training_table(content)))
    return [Table(t.heads, t.rows, head, text) for head, text, t in found if t.rows]


def write_results(folder: Path, content: Json) -> None:
    """Write all files but the page.

    Args:
        folder: of the study.
        content: see :func:`mtpgo_training.study.study_results.results`.
    """
    write_text(folder / "result.json", json.dumps(content, indent=1, allow_nan=False) + "\n")
    write_text(folder / "result.csv", to_csv(content))
    parts = [f"# {heading(content)}"]
    for table in sections(content):
        parts += [f"## {table.heading}"] if table.heading else []
        parts += [table.text, to_markdown(table)]
    missing = gaps(content)
    if missing:
        parts += ["## Gaps", "\n".join(f"- {text}" for text in missing)]
    write_text(folder / "result.md", "\n\n".join(parts) + "\n")
    write_text(folder / "result.tex", to_latex(content, heading(content)))
