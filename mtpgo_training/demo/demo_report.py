# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Result of the demo as ``summary.json`` and as the table printed to the terminal."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np

from mtpgo_core.schema import Source
from mtpgo_core.task.task_description import TaskDescription
from mtpgo_training.demo.publication_timing import PublicationTiming
from mtpgo_training.demo.recorded_messages import ReceivedPrediction, RecordedMessages
from mtpgo_training.evaluation.bags.bag_evaluation import FALLBACK_SHARE
from mtpgo_training.evaluation.scores.score_summary import MOVING_TITLE
from mtpgo_training.evaluation.scores.score_table import HEADLINE_TIMES_S, Averages
from mtpgo_training.table_format import Row, Table, to_text

MODEL, PROTOCOL = "mtpgo", "all"
"""Name of the model in the score tables, and the protocol that averages over all agents."""

_BASELINES = ("cv", "ca")

_METRICS = {
    "ade_m": "ade",
    "fde_m": "fde",
    "miss_rate": "mr",
    "nll": "anll",
    "fnll": "fnll",
    "min_ade_m": "min_ade",
    "min_fde_m": "min_fde",
    "coverage_50": "coverage_50",
    "coverage_90": "coverage_90",
    "coverage_95": "coverage_95",
    **{key: key for key in HEADLINE_TIMES_S},
}
"""Key in the summary -> key in the score table."""

_HEADS = ("recording", "scenes", "agents", "ADE m", "FDE m", "MR", "NLL")
_CV_HEADS = ("CV ADE", "CV FDE", "CV MR", "CV NLL")

_RESULTS_TEXT = (
    "The model beside constant velocity (CV). moving 90%: share of moving road users whose truth "
    "is inside the most probable mode's 90 % ellipse at that time; 0.9 is right."
)

_PACKAGES = ("mtpgo_ros", "torch", "numpy", "rosbags", "ros-rclpy")


@dataclass(frozen=True)
class DemoResult:
    """Result of one recording, or of all of them together.

    Attributes:
        name: name of the recording, "all" for all of them.
        predictions: the received predictions.
        timing: their punctuality and completeness.
        scores: scores of the predictions and of the baselines.
    """

    name: str
    predictions: Sequence[ReceivedPrediction]
    timing: PublicationTiming
    scores: Averages

    def row(self) -> dict[str, Any]:
        """Return the values of ``summary.json``, explained in docs/demo.md; undefined is None."""
        timing = self.timing
        row: dict[str, Any] = {
            "predictions_published": sum(len(r.prediction) for r in self.predictions),
            "scenes": timing.published,
            "cycles": timing.cycles,
            "agents_max": timing.agents_max,
            "deadline_misses": timing.deadline_misses,
            "missed_cycles": timing.missed,
            "late_predictions": timing.late,
            "missing_predictions": timing.missing_agents,
            "fallback_predictions": sum(
                int((r.prediction.source != Source.MODEL).sum()) for r in self.predictions
            ),
            "latency_ms_p50": _percentile(timing.latency_ms, 50.0),
            "latency_ms_p99": _percentile(timing.latency_ms, 99.0),
            "latency_ms_max": _percentile(timing.latency_ms, 100.0),
        }
        row |= {key: self._score(MODEL, name) for key, name in _METRICS.items()}
        for baseline in _BASELINES:
            row |= {
                f"{baseline}_{key}": self._score(baseline, _METRICS[key])
                for key in ("ade_m", "fde_m", "miss_rate", "nll")
            }
        return row

    def _score(self, model: str, name: str) -> float | None:
        return self.scores.get(model, {}).get(PROTOCOL, {}).get(name)


def summary(
    total: DemoResult,
    parts: Sequence[DemoResult],
    task: TaskDescription,
    recorded: RecordedMessages,
) -> dict[str, Any]:
    """Return the content of ``summary.json``.

    Args:
        total: result of all recordings together.
        parts: result of each recording.
        task: description of the model.
        recorded: the recorded messages.
    """
    timing = recorded.diagnostics.get("predictor: timing", {})
    return total.row() | {
        "node_deadline_misses": int(timing.get("deadline_misses", 0)),
        "node_processing_ms_p50": _percentile(np.array(recorded.processing_ms), 50.0),
        "node_processing_ms_p99": _percentile(np.array(recorded.processing_ms), 99.0),
        "recordings": {part.name: part.row() for part in parts},
        "model": {
            "name": task.name,
            "version": task.version,
            "weights_sha256": task.weights_sha256,
        },
        "versions": versions(),
    }


def to_json(content: Mapping[str, Any]) -> str:
    """Return the text of ``summary.json``."""
    return json.dumps(content, indent=2, allow_nan=False) + "\n"


def results_table(content: Mapping[str, Any]) -> Table:
    """Return the scores of each recording beside constant velocity's.

    Args:
        content: content of ``summary.json``.
    """
    rows, headline = [], _headline(content)
    for name, row in _by_recording(content).items():
        keys = ("ade_m", "fde_m", "miss_rate", "nll", headline)
        own = [_cell(row[key]) for key in keys]
        cv = [_cell(row[key]) for key in ("cv_ade_m", "cv_fde_m", "cv_miss_rate", "cv_nll")]
        rows.append(Row(name, [str(row["scenes"]), str(row["agents_max"]), *own, *cv]))
    heads = [*_HEADS, MOVING_TITLE.format(HEADLINE_TIMES_S[headline]), *_CV_HEADS]
    return Table(heads, rows, "Results", _RESULTS_TEXT)


def _headline(content: Mapping[str, Any]) -> str:
    """Return the name of the coverage of moving road users at 5 s, or earlier if that is unknown.

    Args:
        content: content of ``summary.json``.
    """
    *shorter, last = HEADLINE_TIMES_S
    return next((key for key in (last, *reversed(shorter)) if content[key] is not None), last)


def _by_recording(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the rows by recording and, of several, that of all."""
    parts = dict(content["recordings"])
    return parts | {"all": content} if len(parts) > 1 else parts


def terminal_table(content: Mapping[str, Any]) -> str:
    """Return the table that the demo prints, from the content of ``summary.json``."""
    table = results_table(content)
    heads, bar = table.heads, table.heads.index(_CV_HEADS[0])
    rows = [Row(r.name, [*r.cells[: bar - 1], "|", *r.cells[bar - 1 :]]) for r in table.rows]
    lines = to_text(Table([*heads[:bar], "|", *heads[bar:]], rows)).splitlines()
    rule = "-" * len(lines[0])
    return "\n".join([lines[0], rule, *lines[1:-1], *([rule] if len(rows) > 1 else []), lines[-1]])


def sentences(content: Mapping[str, Any], rate: float) -> list[str]:
    """Return sentences about completeness and latency, which are not in the table.

    Args:
        content: content of ``summary.json``.
        rate: configured predictions per second (Hz).
    """
    answered = content["cycles"] - content["missed_cycles"]
    lines = [
        f"{answered} of {content['cycles']} cycles answered at {rate:g} Hz, "
        f"{content['late_predictions']} late; {content['predictions_published']} predictions of "
        f"single road users, {content['missing_predictions']} missing, "
        f"{content['fallback_predictions']} by constant velocity instead of the model.",
    ]
    share = content["fallback_predictions"] / max(1, content["predictions_published"])
    if share > FALLBACK_SHARE:
        lines.append(
            f"{share:.0%} are by constant velocity, so these scores say little about the"
            " model. Usually the machine is too busy or too slow, see logs/predictor.log: close"
            " other programs, or set -p rate:=2.0, and run the demo again."
        )
    if content["latency_ms_p50"] is not None:
        lines.append(
            f"Latency from observation to prediction, both as received by a third process: "
            f"{content['latency_ms_p50']:.1f} ms median, "
            f"{content['latency_ms_p99']:.1f} ms p99."
        )
    return lines


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that affect the result."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for name in _PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def _percentile(values: np.ndarray, percent: float) -> float | None:
    return round(float(np.percentile(values, percent)), 3) if values.size else None


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
