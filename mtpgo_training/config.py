# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The configuration of a training: typed, with defaults, read from YAML, saved with the run."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.task import HistoryConfig, SceneConfig, from_dict
from mtpgo_training.schedule import LEARNING_RATE_SCHEDULES


def _positive(name: str, value: float) -> None:
    if not value > 0:
        raise ConfigurationError(f"{name} is {value!r}, expected more than 0")


def _share(name: str, value: float) -> None:
    if not 0.0 <= value <= 1.0:
        raise ConfigurationError(f"{name} is {value!r}, expected 0 to 1")


@dataclass(frozen=True)
class DataConfig:
    """Which recordings teach, which judge, and how scenes are cut from them.

    A recording is named ``NAME`` or ``DIRECTORY/NAME``, the directory's last part. Recordings are
    never divided: a whole one teaches or judges.

    Attributes:
        validation: names of the recordings that choose the checkpoint.
        test: names of the recordings that are left alone.
        train: names of those that teach; empty for all others.
        validation_fraction: share of the recordings drawn for validation where ``validation`` is
            empty.
        stride_s: time between two windows of a training recording (s).
        validation_stride_s: likewise of a validation recording (s).
        restart_probability: share of the training scenes in which every agent was first seen
            within the last ``restart_within_s``, as after an occlusion or a tracker's restart.
        restart_within_s: longest time such agents have been seen (s).
        mirror_probability: share of the training scenes that are mirrored (left for right): it
            doubles the data where the side of the road does not matter.
        rotation_std_rad: standard deviation of a random turn of the training scenes (rad), for
            sites where the scene's frame has no preferred direction.
        scale_std: standard deviation of the logarithm of a random scale of the training scenes:
            all lengths, speeds and accelerations by one factor.
        velocity_smoothing_s: standard deviation of the kernel that smooths the target velocities
            (s), 0 for the recorded ones; see :class:`mtpgo_training.futures.FutureTable`.
        standing_weight: weight in the loss of an agent that stands now and does not move over its
            observed future, and its chance to be a graph's centre; below 1 more of the learning
            goes to those that move.
        min_future_s: an agent whose future is known for a shorter time is not a graph's centre in
            training (s): the end of a recording costs as much as its middle and teaches less.
        source_weight: how often a directory's scenes are drawn, by the directory's last part;
            1 where not named.
    """

    validation: tuple[str, ...] = ()
    test: tuple[str, ...] = ()
    train: tuple[str, ...] = ()
    validation_fraction: float = 0.1
    stride_s: float = 0.2
    validation_stride_s: float = 1.0
    restart_probability: float = 0.15
    restart_within_s: float = 1.2
    mirror_probability: float = 0.0
    rotation_std_rad: float = 0.0
    scale_std: float = 0.0
    velocity_smoothing_s: float = 0.0
    standing_weight: float = 1.0
    min_future_s: float = 0.0
    source_weight: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("stride_s", "validation_stride_s", "restart_within_s"):
            _positive(f"data.{name}", getattr(self, name))
        for name in ("restart_probability", "mirror_probability", "standing_weight"):
            _share(f"data.{name}", getattr(self, name))
        _share("data.validation_fraction", self.validation_fraction)


@dataclass(frozen=True)
class OptimisationConfig:
    """How the weights move.

    Attributes:
        epochs: E of algorithm 1.
        batch_scenes: graphs in a batch.
        learning_rate: its peak.
        learning_rate_schedule: one of ``LEARNING_RATE_SCHEDULES``.
        warmup_steps: optimisation steps of the linear rise.
        learning_rate_floor: share of the peak that is left at the end of ``cosine``.
        weight_decay: of AdamW; 0 is plain Adam.
        clip_norm: largest norm of the gradient.
        huber_delta: error at which the EWTA loss turns linear (m, m/s).
        mean_weight: share of the expected Huber loss beside the likelihood; 0 as in the paper, see
            :func:`mtpgo_training.losses.expected_huber`.
        teacher_forcing: probability at the start that a roll-out is fed the observed states; it
            falls linearly to zero at the end of the warm-up (total / 4). The default is none: the
            state already starts at the observed one, and a predictor must live with its own steps.
        average_decay: decay of the exponential moving average of the weights that is validated
            and exported; 0 for none.
    """

    epochs: int = 40
    batch_scenes: int = 128
    learning_rate: float = 2e-3
    learning_rate_schedule: str = "cosine"
    warmup_steps: int = 20
    learning_rate_floor: float = 0.02
    weight_decay: float = 0.0
    clip_norm: float = 1.0
    huber_delta: float = 1.0
    mean_weight: float = 0.0
    teacher_forcing: float = 0.0
    average_decay: float = 0.0

    def __post_init__(self) -> None:
        for name in ("epochs", "batch_scenes", "learning_rate", "clip_norm", "huber_delta"):
            _positive(f"optimisation.{name}", getattr(self, name))
        _share("optimisation.teacher_forcing", self.teacher_forcing)
        _share("optimisation.average_decay", self.average_decay)
        if self.learning_rate_schedule not in LEARNING_RATE_SCHEDULES:
            raise ConfigurationError(
                f"optimisation.learning_rate_schedule is {self.learning_rate_schedule!r}, "
                f"expected one of {', '.join(repr(s) for s in LEARNING_RATE_SCHEDULES)}"
            )


@dataclass(frozen=True)
class TrainingConfig:
    """Everything that determines a training, but the recordings themselves.

    Attributes:
        name: name of the model that comes out.
        seed: of the initial weights, the order and the augmentation.
        num_threads: threads of torch; 0 leaves torch's own choice.
        data: see :class:`DataConfig`.
        history: see :class:`mtpgo_core.task.HistoryConfig`; travels with the model.
        scene: see :class:`mtpgo_core.task.SceneConfig`; travels with the model.
        model: fields of :class:`models.config.ModelConfig`; sizes that follow from the task
            (features, steps, classes) are set from it.
        optimisation: see :class:`OptimisationConfig`.
        licence: the terms of the data, written into the exported file.
        attribution: who is to be named as the data's source, likewise.
    """

    name: str = "model"
    seed: int = 1
    num_threads: int = 2
    data: DataConfig = DataConfig()
    history: HistoryConfig = field(default_factory=HistoryConfig)
    scene: SceneConfig = field(default_factory=SceneConfig)
    model: dict[str, Any] = field(default_factory=dict)
    optimisation: OptimisationConfig = OptimisationConfig()
    licence: str = ""
    attribution: str = ""


def load_config(path: Path) -> TrainingConfig:
    """The configuration in a YAML file.

    Raises:
        ConfigurationError: the file cannot be read, is no YAML mapping, or has an unknown or
            ill-typed field; the sentence names the file and the field.
    """
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigurationError(
            f"the configuration {path} cannot be read: {error.strerror}"
        ) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        reason = " ".join(str(error).split())
        raise ConfigurationError(f"the configuration {path} is no YAML: {reason}") from error
    return from_dict(TrainingConfig, {} if data is None else data, str(path))


def dump_config(config: TrainingConfig) -> str:
    """YAML text from which :func:`load_config` reads the same configuration."""
    return yaml.safe_dump(_plain(dataclasses.asdict(config)), sort_keys=False)


def _plain(value: Any) -> Any:
    """Tuples as lists, which YAML can write."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value
