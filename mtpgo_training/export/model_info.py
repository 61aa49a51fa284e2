# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Description of a model file as text."""

from __future__ import annotations

from typing import Any

from mtpgo_core.task.task_description import TaskDescription
from mtpgo_training.calibration.calibration_text import (
    calibration_text,
    is_moving_score,
    moving_text,
)
from mtpgo_training.data.splits import USES
from mtpgo_training.evaluation.training_overlap import CALIBRATION


def _static_inputs(task: TaskDescription) -> str:
    """Return which static features the network sees."""
    if not task.model.get("static_features", False):
        return "none: the network does not see the class"
    others = task.scene.static_features[len(task.scene.classes) :]
    return ", ".join((f"class ({', '.join(task.scene.classes)})", *others))


def model_text(task: TaskDescription) -> str:
    """Return the description of a model as printed to the terminal."""
    training = task.training
    calibration = calibration_text(task.calibration, task.history.dt_s)
    scale = task.model.get("covariance_scale", 1.0)
    if task.calibration.is_none and scale != 1.0:
        calibration = [f"one factor of {scale:.2f} on all covariances"]
    lines = [
        f"{task.name} (exported by version {task.version or 'unknown'})",
        f"network    {task.model.get('network', 'mtp-go')}",
        f"states     {', '.join(task.states)}",
        f"horizon    {task.horizon_steps} steps of {task.history.dt_s} s, {task.modes} modes"
        + (f", spread by {task.least_mode_spread:g} sigma or more" * bool(task.least_mode_spread)),
        f"history    {task.history.steps} steps of {task.history.dt_s} s",
        f"scene      policy {task.scene.policy}, frame {task.scene.frame}, up to "
        f"{task.scene.max_neighbours} neighbours within {task.scene.radius_m:g} m",
        f"features   {', '.join(task.scene.features)}",
        f"static     {_static_inputs(task)}",
        *(["trails     used: the ways of earlier road users"] * task.scene.trails),
        *(["lanes      used: those of a lane file or of lane markings"] * task.scene.uses_lanes),
        f"weights    sha256 {task.weights_sha256}",
    ]
    lines += [f"{'' if i else 'calibrated':<10} {line}" for i, line in enumerate(calibration)]
    for where, models in task.metrics.items():
        coverage = moving_text(models.get("model", {}).get("all", {}))
        if coverage:
            lines.append(f"coverage   {where}: {coverage}")
    for use in (*USES, CALIBRATION):
        names = [
            f"{r.get('source')}/{r.get('name')}"
            for r in training.get("recordings", [])
            if r.get("split") == use
        ]
        if names or use in USES:
            lines.append(f"{use:<10} {', '.join(names) or '-'}")
    candidates = training.get("chosen_from", [])
    if candidates:
        scores = ", ".join(f"{r['validation_ade_m']:.3f} m (seed {r['seed']})" for r in candidates)
        lines.append(f"chosen     from {len(candidates)} runs by validation ADE: {scores}")
    origin = training.get("adapted_from")
    if origin:
        lines.append(f"adapted    from {origin['name']}, sha256 {origin['weights_sha256']}")
    for key in ("licence", "attribution"):
        if training.get(key):
            lines.append(f"{key:<10} {training[key]}")
    for where, models in task.metrics.items():
        rows = _score_lines(models)
        if rows:
            lines += [f"metrics    {where}:", *rows]
    return "\n".join(lines)


def _score_lines(models: dict[str, Any]) -> list[str]:
    """Return a line for the scores of each model and protocol on one data set."""
    lines = []
    for model, protocols in models.items():
        for protocol, scores in protocols.items():
            values = "  ".join(
                f"{name} {value:.3f}" if isinstance(value, float) else f"{name} {value}"
                for name, value in scores.items()
                if value is not None and not is_moving_score(name)
            )
            if values:
                lines.append(f"           {model:<6} {protocol:<7} {values}")
    return lines
