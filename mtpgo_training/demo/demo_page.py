# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The demo's report: one page with the tables that are printed, and figures of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mtpgo_training.demo.demo_report import results_table, sentences
from mtpgo_training.demo.live_comparison import difference_sentences, live_comparison_table
from mtpgo_training.reports.figures import draw_live_figures
from mtpgo_training.reports.honesty.live_scores import calibration_effect_table
from mtpgo_training.reports.page import PAGE_NAME, prepare_folder, render_page


def write_demo_page(content: Mapping[str, Any], rate_hz: float, folder: Path) -> Path:
    """Write the page and its figures (PNG), and return the page.

    Args:
        content: content of ``summary.json``.
        rate_hz: configured predictions per second (Hz).
        folder: where to.
    """
    prepare_folder(folder)
    model, live, effect = content["model"], content["live"], content["calibration"]
    rows = [{**row, **row["live"]} for row in live]
    tables = [results_table(content), live_comparison_table(live) if live else None]
    tables.append(calibration_effect_table(effect))
    facts = [("model", f"{model['name']}, weights {model['weights_sha256'][:16]}")]
    facts += [("node", sentence) for sentence in sentences(content, rate_hz)]
    facts += [("live scores", sentence) for sentence in difference_sentences(live)]
    facts += list(content["versions"].items())
    page = folder / PAGE_NAME
    render_page(
        page,
        title=f"Demo of {model['name']}",
        subtitle=f"Through the real node: {', '.join(content['recordings'])}.",
        tables=[table for table in tables if table is not None],
        figures=draw_live_figures({"": rows}, effect, folder),
        facts=facts,
    )
    return page
