# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The figures of a study: learning curves, and errors beyond the horizon of the training."""

from __future__ import annotations

import base64
import io
from typing import Any

from matplotlib import colormaps
from matplotlib.figure import Figure

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.reports.learning_curve import read_log
from mtpgo_training.reports.series import draw_line
from mtpgo_training.study.study_folder import StudyFolder

Json = dict[str, Any]


def learning_curves(folder: StudyFolder, content: Json) -> bytes | None:
    """Return a PNG of the validation ADE over the time of training, None without any run.

    A line for each seed, a colour for each row.

    Args:
        folder: of the study.
        content: see :func:`mtpgo_training.study.study_results.results`.
    """
    figure, axes = _axes("training (min)", "validation ADE (m)")
    drawn, cv = False, None
    for i, row in enumerate(content["rows"]):
        label = row["title"]
        for seed in row["seeds"]:
            try:
                log = read_log(folder.run(row["name"], seed).run)
            except ConfigurationError:
                continue
            minutes = [float(line["total_seconds"]) / 60.0 for line in log]
            values = [float(line["all_ade"]) for line in log]
            axes.plot(minutes, values, ".-", color=_colour(i), label=label, linewidth=1.0)
            label, drawn, cv = "_", True, float(log[0]["cv_all_ade"])
    if not drawn:
        return None
    if cv is not None:
        axes.axhline(cv, linestyle=":", color="0.4", label="CV")
        axes.set_ylim(0.0, 2.0 * cv)
    return _png(figure)


def extrapolation_curves(content: Json) -> bytes | None:
    """Return a PNG of the error over the time ahead, None without an extrapolation.

    The dashed line is the horizon of the training.
    """
    figure, axes = _axes("time ahead (s)", "distance from the truth (m)")
    runs: list[Json] = []
    for i, row in enumerate(content["rows"]):
        label = row["title"]
        for one in row["extrapolation"]:
            if "gap" in one:
                continue
            draw_line(axes, one["time_s"], _known(one["model"]), color=_colour(i), label=label)
            runs.append(one)
            label = "_"
    if not runs:
        return None
    for name, style in (("cv", ":"), ("ca", "-.")):
        if name in runs[0]:
            values = _known(runs[0][name])
            times = runs[0]["time_s"]
            draw_line(axes, times, values, style, color="0.4", label=name.upper())
    axes.axvline(runs[0]["trained_s"], linestyle="--", color="0.6")
    highest = max(max(v for v in one["model"] if v is not None) for one in runs)
    axes.set_ylim(0.0, 1.2 * highest)
    return _png(figure)


def as_image(png: bytes, alternative: str) -> str:
    """Return an ``<img>`` that contains the picture."""
    data = base64.b64encode(png).decode()
    return f'<img alt="{alternative}" src="data:image/png;base64,{data}">'


def _axes(x: str, y: str) -> tuple[Figure, Any]:
    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    axes = figure.add_subplot()
    axes.set(xlabel=x, ylabel=y)
    axes.grid(alpha=0.3)
    return figure, axes


def _colour(number: int) -> Any:
    return colormaps["tab10"](number % 10)


def _known(values: list[float | None]) -> list[float]:
    return [float("nan") if value is None else value for value in values]


def _png(figure: Figure) -> bytes:
    figure.axes[0].legend(fontsize="small", ncols=2)
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=110)
    return file.getvalue()
