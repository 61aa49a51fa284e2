# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Exports a checkpoint as the TorchScript model file that the node runs."""

from __future__ import annotations

import dataclasses
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from models.network_config import NetworkConfig
from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_core.errors import ConfigurationError, ModelFileError
from mtpgo_core.options import from_dict, require
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.task.calibration import Calibration
from mtpgo_core.task.model_file import content_sha256, read_model
from mtpgo_core.task.task_description import TASK_FILE, TaskDescription
from mtpgo_core.task.torchscript import torchscript
from mtpgo_training.atomic_files import replacing
from mtpgo_training.calibration.calibration_fit import fit_calibration
from mtpgo_training.calibration.calibration_report import (
    calibration_table,
    leave_one_site_out,
    moving_scores,
)
from mtpgo_training.calibration.calibration_samples import CalibrationSamples
from mtpgo_training.evaluation.training_overlap import CALIBRATION
from mtpgo_training.export.model_calibration import (
    calibrated_metrics,
    check_coverage,
    own_calibration,
)
from mtpgo_training.export.run_selection import Candidate, select_run
from mtpgo_training.table_format import Table
from mtpgo_training.training.networks import (
    MTP_GO,
    NETWORKS,
    family,
    name_of,
    rebuild,
    weights_hash,
)
from mtpgo_training.training.run_folder import Checkpoint, versions
from mtpgo_training.training.training_config import TrainingConfig

LARGEST_DIFFERENCE_M = 1e-4
"""Largest difference between exported and eager model: of the means (m), of the logarithmic mode
weights, and of the covariances as a share of the variance. Chosen: three
times what was measured with an untrained default model, 3.4e-5."""

STATE_NAMES = ("x", "y", "vx", "vy")
"""The states in their order: position (m) and velocity (m/s) in the scene frame."""


@dataclass(frozen=True)
class Export:
    """An exported model.

    Attributes:
        task: the task description in the file.
        run: the exported run.
        candidates: all runs in the order given.
        warnings: sentences about its ellipses.
        left_out: what the calibration brings to each site by a fit to the others, None where the
            model has its own calibration.
    """

    task: TaskDescription
    run: Candidate
    candidates: list[Candidate]
    warnings: list[str]
    left_out: Table | None = None


def export_runs(
    paths: Sequence[Path],
    output: Path,
    *,
    name: str | None = None,
    calibrated: bool = True,
    samples: CalibrationSamples | None = None,
    force: bool = False,
    site: str | None = None,
) -> Export:
    """Export the run with the smallest validation ADE.

    Args:
        paths: checkpoints or run folders.
        output: model file to write.
        name: name of the model, the configuration's by default.
        calibrated: apply a calibration: that of the checkpoint, fitted to the validation
            recordings, or the one fitted to ``samples``.
        samples: predictions on sites that were left out of a training.
        force: export a model whose ellipses hold too few or too many road users.
        site: location at which the model is to be served, for one with origins by site; None
            keeps the origin of each, with which recordings can be evaluated.

    Raises:
        MtpgoError: a checkpoint is unusable, the ellipses are, or the file cannot be written.
    """
    best, candidates = select_run(paths)
    # First: what follows relies on a checkpoint whose network can be built.
    model = load_model(best.checkpoint, calibrated=calibrated and samples is None)
    described = describe(best.checkpoint, name)
    if site is not None:
        require(
            "--site", site, bool(described.scene.site_origins), "none: the model has one origin"
        )
        described = dataclasses.replace(described, scene=described.scene.at_site(site))
    table, honest = None, {}
    if samples is None:
        calibration = own_calibration(best.checkpoint) if calibrated else Calibration()
    else:
        _require_same_output(samples, best.checkpoint)
        calibration = fit_calibration(samples, left_out=True)
        used = [{**dataclasses.asdict(one), "split": CALIBRATION} for one in samples.recordings]
        known = [*described.training["recordings"], *used]
        described = dataclasses.replace(
            described, training={**described.training, "recordings": known}
        )
        if len(calibration.sites) > 1:
            left_out = leave_one_site_out(samples)
            table = calibration_table(samples, left_out)
            honest = {"left-out sites": {"model": {"all": moving_scores(left_out)}}}
    validation = calibrated_metrics(best, calibration)
    warning = check_coverage(validation, force=force)
    task = dataclasses.replace(
        described,
        calibration=calibration,
        metrics={"validation": validation, **honest},
    )
    if len(candidates) > 1:
        scores = [{"seed": c.seed, "validation_ade_m": c.ade_m} for c in candidates]
        task = dataclasses.replace(task, training={**task.training, "chosen_from": scores})
    task = export_model(model, task, output)
    return Export(task, best, candidates, [warning] if warning else [], table)


def export_model(model: TrajectoryPredictor, task: TaskDescription, path: Path) -> TaskDescription:
    """Script, freeze and save a model with its task description, and check the file.

    Args:
        model: the network.
        task: description of its task; the hashes and what the network determines (states, horizon,
            modes) are filled in.
        path: model file, written atomically.

    Returns:
        The task description in the file.

    Raises:
        ModelFileError: the exported model does not compute what the eager one does.
        ConfigurationError: the file cannot be written.
    """
    model, name = model.eval(), name_of(model)
    task = dataclasses.replace(
        task,
        content_sha256="",
        states=STATE_NAMES[: model.config.state_size],
        horizon_steps=model.config.horizon_steps,
        modes=model.config.modes,
        least_mode_spread=model.config.least_mode_spread,
        model={"network": name, **model.config.to_dict()},
        weights_sha256=weights_hash(model),
    )
    with torchscript(), replacing(path) as temporary:
        frozen = torch.jit.freeze(torch.jit.script(NETWORKS[name].deployed(model)))
        _save(frozen, task, temporary)
        # The hash of the content is known once it has been written.
        content = content_sha256(read_model(temporary).archive.records())
        task = dataclasses.replace(task, content_sha256=content)
        _save(frozen, task, temporary)
        _check(model, temporary)
    return task


def load_model(checkpoint: Checkpoint, *, calibrated: bool = True) -> TrajectoryPredictor:
    """Return the network of a checkpoint with its averaged weights.

    Args:
        checkpoint: content of a checkpoint of ``mtpgo train``.
        calibrated: scale the covariances by the one factor that checkpoints of earlier versions
            have instead of a calibration.

    Raises:
        ConfigurationError: the checkpoint belongs to another architecture.
    """
    name = checkpoint.get("network", MTP_GO)
    family(name)  # An unknown network is an error of its own.
    try:
        config = dict(checkpoint["model_config"])
        if calibrated:
            config["covariance_scale"] = checkpoint.get("covariance_scale", 1.0)
        model = rebuild(name, config)
        model.load_state_dict(checkpoint["average"])
    except (KeyError, ConfigurationError, RuntimeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ConfigurationError(
            f"the checkpoint does not fit this version's network: {reason}"
        ) from error
    return model.eval()


def describe(checkpoint: Checkpoint, name: str | None = None) -> TaskDescription:
    """Return the task description of a checkpoint.

    Args:
        checkpoint: content of a checkpoint of ``mtpgo train``.
        name: name of the model, the configuration's by default.
    """
    config = from_dict(TrainingConfig, checkpoint["config"], "the checkpoint's configuration")
    plain: dict[str, Any] = json.loads(json.dumps(checkpoint["config"]))
    origin = {"adapted_from": checkpoint["adapted_from"]} if "adapted_from" in checkpoint else {}
    return TaskDescription(
        name=name or config.name,
        version=_version(),
        history=config.history,
        scene=config.scene,
        training={
            "recordings": checkpoint["splits"],
            "licence": config.licence,
            "attribution": config.attribution,
            "configuration": {k: plain[k] for k in ("data", "optimisation", "seed")},
            "epochs": checkpoint["epoch"],
            "steps": checkpoint["step"],
            "versions": versions(),
            **origin,
        },
        metrics={"validation": checkpoint["metrics"]},
    )


def _require_same_output(samples: CalibrationSamples, checkpoint: Checkpoint) -> None:
    """Check that samples are of models with the horizon and the modes of a checkpoint.

    Raises:
        ConfigurationError: they are not.
    """
    config = checkpoint["model_config"]
    expected = (config["horizon_steps"], config["dt_s"], config["modes"])
    given = (samples.distance.shape[1], samples.step_s, samples.log_weight.shape[1])
    if given != expected:
        text = "{} steps of {:g} s, {} modes"
        raise ConfigurationError(
            f"the samples for the calibration are of models with {text.format(*given)}, expected "
            f"those of the checkpoint, {text.format(*expected)}"
        )


def _check(model: TrajectoryPredictor, path: Path) -> None:
    """Check the file against the eager model, on agents with gaps and padding."""
    ModelRunner.load(path, num_threads=None, trusted=True)  # as the node checks it
    loaded = torch.jit.load(str(path))
    example = _example(model.config)
    with torch.inference_mode():
        expected, given = model(*example), loaded(*example)
    # Covariances are compared relative to the variance: in float32 a variance of 900 m^2 has a
    # resolution of 1e-4 m^2 at best.
    variances = torch.diagonal(expected[2], dim1=-2, dim2=-1)
    scale = variances.mean(-1).clamp(min=1.0)[..., None, None]
    scales = (1.0, 1.0, scale)
    difference = max(
        float(((a - b).abs() / size).max())
        for a, b, size in zip(expected, given, scales, strict=True)
    )
    if not difference <= LARGEST_DIFFERENCE_M:
        raise ModelFileError(
            f"the exported model differs from the eager one by {difference:.2e}, expected at most "
            f"{LARGEST_DIFFERENCE_M:.0e}"
        )


def _example(config: NetworkConfig) -> tuple[Tensor, Tensor, Tensor, None, Tensor | None]:
    """Return inputs for two scenes of five agents at driving speeds, some late, some absent."""
    draw = torch.Generator().manual_seed(0)
    shape, size = (2, 5, config.history_steps), config.feature_size
    time = torch.arange(1 - config.history_steps, 1) * config.dt_s
    velocity = torch.randn(2, 5, 1, 2, generator=draw) * 8.0
    start = torch.randn(2, 5, 1, 2, generator=draw) * 20.0
    features = 0.3 * torch.randn(*shape, config.feature_size, generator=draw)
    features[..., 0:2] = start + velocity * time[:, None]
    features[..., 2:4] = velocity.expand(*shape, 2)
    course = torch.atan2(velocity[..., 1], velocity[..., 0]).expand(*shape)
    features[..., 6:8] = torch.stack((course.cos(), course.sin()), -1)[..., : size - 6]
    valid = torch.ones(shape, dtype=torch.bool)
    valid[0, 1, : config.history_steps - 1] = False
    valid[1, 3:] = False
    features = features * valid[..., None]
    static = torch.zeros(2, 5, config.static_size)
    if config.static_size:
        static[..., 0] = 1.0
    branches = getattr(config, "trail_branches", 0)
    if not branches:
        return features, valid, static, None, None
    trails = torch.randn(2, 5, branches, config.horizon_steps, 3, generator=draw)
    trails[..., 2] = trails[..., 2].relu()
    return features, valid, static, None, trails


def _version() -> str:
    try:
        return metadata.version("mtpgo_ros")
    except metadata.PackageNotFoundError:
        return ""


def _save(frozen: torch.jit.ScriptModule, task: TaskDescription, path: Path) -> None:
    buffer = io.BytesIO()  # torch tells of a full disk in errors of its own
    torch.jit.save(frozen, buffer, _extra_files={TASK_FILE: task.to_json()})
    path.write_bytes(buffer.getbuffer())
