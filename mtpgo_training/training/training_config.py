# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The configuration of a training run: typed, with defaults, read from and written to YAML."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import (
    LARGEST_SEED,
    LARGEST_THREADS,
    check_options,
    from_dict,
    listed,
    option,
    require,
)
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig
from mtpgo_core.yaml_file import dump_yaml, parse_yaml
from mtpgo_training.data.data_config import CLASSES, DataConfig, with_preset
from mtpgo_training.training.losses.schedules import LEARNING_RATE_SCHEDULES, WARM_UP_SHARE

ACCELERATORS = ("auto", "cpu", "gpu", "mps")
STRATEGIES = ("auto", "ddp")
PRECISIONS = ("32-true", "bf16-mixed", "16-mixed")
"""Choices of Fabric that are tested with these networks, which are small and fit on one device."""

LIKELIHOODS = ("step", "trajectory", "mode")
"""What the mixture is a distribution of."""

REDUCTIONS = ("mean", "sum")
"""How a loss is made of the steps of a trajectory."""

TEACHER_FORCING_SCHEDULES = ("warm_up", "constant")
"""When teacher forcing is used."""

KEEP = ("best", "last")
"""Which epoch's weights are exported."""


@dataclass(frozen=True)
class OptimisationConfig:
    """Losses, optimiser and schedules.

    Attributes:
        epochs: length of the schedule of Algorithm 1.
        warm_up_share: share of the epochs with an EWTA loss, W / total in Algorithm 1; 0 trains on
            the likelihood from the start, for trained weights that are to be improved.
        batch_scenes: graphs in a batch.
        learning_rate: peak of the learning rate.
        learning_rate_schedule: one of ``LEARNING_RATE_SCHEDULES``.
        warmup_steps: optimisation steps of the linear rise.
        learning_rate_floor: share of the peak at the end of ``cosine``.
        weight_decay: of AdamW; 0 is Adam.
        clip_norm: largest norm of the gradient.
        huber_delta: error at which the EWTA and the Huber losses turn linear (m, m/s).
        mean_weight: weight of the expected Huber loss relative to the likelihood; 0 as in the
            paper, see :func:`mtpgo_training.training.losses.huber_terms.expected_huber_loss`.
        heaviest_weight: weight of the Huber loss of the heaviest component, see
            :func:`mtpgo_training.training.losses.huber_terms.heaviest_huber_loss`; 0 as in the
            paper.
        consistency_weight: weight of the distance of each mode of a moving vehicle from what is
            predicted for the same times one window later (``data.stride_s``), see
            :func:`mtpgo_training.training.losses.consistency_loss.consistency_loss`; 0 as in the
            paper. It nearly doubles the time of a step.
        likelihood: ``step``: the paper's, a mixture at every step (eq. 27); ``trajectory``: a
            mixture of whole trajectories, see
            :func:`mtpgo_training.training.losses.likelihood_loss.trajectory_likelihood_loss`;
            ``mode``: each mode on its own, see
            :func:`mtpgo_training.training.losses.likelihood_loss.mode_likelihood_loss`.
        reduction: ``mean``: losses are averages over winners and observed agent-steps; ``sum``:
            sums over them for each agent, averaged over the agents, as in the paper (eqs. 27 and
            28). Only with the likelihood ``step`` and without the losses that are not the paper's.
        calibrated: fit a calibration of the output to the validation; false as in the paper.
        train_only: prefixes of the names of the parameters that are trained, for instance
            ``noise``, ``initial_covariance`` and ``mixture``; empty for all.
        calibration_epochs: the last epochs, in which only the covariances are trained, on the
            likelihood ``mode``; the network after them is exported.
        calibration_learning_rate: peak of the learning rate in these epochs.
        correlated_steps: steps that count as one in the likelihood of a trajectory.
        teacher_forcing: probability at the start that a roll-out is fed the observed states. The
            default is none: the roll-out starts at the observed state, and a predictor has to cope
            with its own errors. The paper has 1 throughout.
        teacher_forcing_schedule: ``warm_up``: the probability falls linearly to zero at the end of
            the warm-up (total / 4); ``constant``: it stays, as in the paper.
        average_decay: decay of the exponential moving average of the weights that is validated
            and exported; 0 for none.
        keep: which epoch is exported, one of ``KEEP``: the ``best`` by validation ADE, or the
            ``last``, if the validation recordings show only a part of what the model is for.
    """

    epochs: int = option(40, above=0)
    warm_up_share: float = option(WARM_UP_SHARE, low=0.0, high=1.0)
    batch_scenes: int = option(128, above=0)
    learning_rate: float = option(2e-3, above=0, below=math.inf)
    learning_rate_schedule: str = option("cosine", choices=LEARNING_RATE_SCHEDULES)
    warmup_steps: int = option(20, low=0)
    learning_rate_floor: float = option(0.02, low=0.0, high=1.0)
    weight_decay: float = option(0.0, low=0.0, below=math.inf)
    clip_norm: float = option(1.0, above=0)
    huber_delta: float = option(1.0, above=0, below=math.inf)
    mean_weight: float = option(0.0, low=0.0, below=math.inf)
    heaviest_weight: float = option(0.0, low=0.0, below=math.inf)
    consistency_weight: float = option(0.0, low=0.0, below=math.inf)
    likelihood: str = option("step", choices=LIKELIHOODS)
    correlated_steps: float = option(5.0, low=1.0)
    reduction: str = option("mean", choices=REDUCTIONS)
    calibrated: bool = True
    train_only: tuple[str, ...] = ()
    calibration_epochs: int = option(0, low=0)
    calibration_learning_rate: float = option(3e-3, above=0, below=math.inf)
    teacher_forcing: float = option(0.0, low=0.0, high=1.0)
    teacher_forcing_schedule: str = option("warm_up", choices=TEACHER_FORCING_SCHEDULES)
    average_decay: float = option(0.0, low=0.0, high=1.0)
    keep: str = option("best", choices=KEEP)

    def __post_init__(self) -> None:
        check_options(self, "optimisation.")
        require(
            "optimisation.calibration_epochs",
            self.calibration_epochs,
            self.calibration_epochs < self.epochs,
            f"below optimisation.epochs, {self.epochs}",
        )
        paper = self.likelihood == "step" and self.calibration_epochs == 0
        paper = paper and self.mean_weight == 0.0 and self.heaviest_weight == 0.0
        paper = paper and self.consistency_weight == 0.0
        require(
            "optimisation.reduction",
            self.reduction,
            paper or self.reduction == "mean",
            "'mean' with mean_weight, heaviest_weight, consistency_weight, calibration_epochs or "
            "another likelihood than 'step'",
        )

    @property
    def main_epochs(self) -> int:
        """Epochs before those in which only the covariances are trained."""
        return self.epochs - self.calibration_epochs


@dataclass(frozen=True)
class TrainerConfig:
    """Devices, precision, validation and checkpoints; none of it changes what is trained.

    Attributes:
        accelerator: one of ``ACCELERATORS``; ``auto`` takes a GPU if there is one.
        devices: devices, or processes on a CPU, on each machine; 0 for all available.
        num_nodes: machines.
        strategy: one of ``STRATEGIES``; ``auto`` is ``ddp`` for more than one device.
        precision: one of ``PRECISIONS``. Validation is always in full precision.
        loader_workers: additional processes that cut the scenes; 0 for none.
        validate_every_epochs: epochs between validations; the last epoch is always validated.
        patience_epochs: stop at a validation this many epochs on the likelihood or more after the
            best one; 0 for never.
        checkpoint_minutes: time between two checkpoints within an epoch (min); one is also written
            at the end of every epoch.
    """

    accelerator: str = option("auto", choices=ACCELERATORS)
    devices: int = option(1, low=0)
    num_nodes: int = option(1, above=0)
    strategy: str = option("auto", choices=STRATEGIES)
    precision: str = option("32-true", choices=PRECISIONS)
    loader_workers: int = option(0, low=0)
    validate_every_epochs: int = option(1, above=0)
    patience_epochs: int = option(0, low=0)
    checkpoint_minutes: float = option(5.0, above=0)

    def __post_init__(self) -> None:
        check_options(self, "trainer.")


@dataclass(frozen=True)
class CrossvalConfig:
    """The sites of ``mtpgo crossval``; a training does not use this section.

    Attributes:
        sites: name of a site -> what belongs to it: directories, recordings (``DIRECTORY/NAME``),
            or sites as they are called by default, ``DIRECTORY-LOCATION`` in a directory with
            several locations. Recordings that are not named are in the site of that default name.
        folds: name of a fold -> the sites that are left out together; each is scored by itself. A
            site in no fold has one of its own, with its name.
    """

    sites: dict[str, list[str]] = field(default_factory=dict)
    folds: dict[str, list[str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for section in ("sites", "folds"):
            for name, entries in getattr(self, section).items():
                named = isinstance(name, str) and name != ""
                require(f"a name in crossval.{section}", name, named, "text")
                texts = isinstance(entries, list) and all(isinstance(e, str) for e in entries)
                valid = texts and len(entries) > 0
                require(f"crossval.{section}.{name}", entries, valid, "a list of names")


@dataclass(frozen=True)
class TrainingConfig:
    """Everything that determines a training run, except the recordings.

    Attributes:
        name: name of the resulting model.
        network: name of the network in :data:`mtpgo_training.training.networks.NETWORKS`.
        seed: of the initial weights, the order of the scenes and the augmentation.
        num_threads: threads of torch; 0 is torch's default. Several processes on a CPU have one
            thread each.
        data: see :class:`DataConfig`.
        history: see :class:`mtpgo_core.task.task_description.HistoryConfig`; stored in the model.
        scene: see :class:`mtpgo_core.task.task_description.SceneConfig`; stored in the model.
        model: options of the network, for ``mtp-go`` the fields of
            :class:`models.mtp_go_config.ModelConfig`; sizes that follow from the task (features,
            steps, classes) are derived.
        optimisation: see :class:`OptimisationConfig`.
        trainer: see :class:`TrainerConfig`.
        crossval: see :class:`CrossvalConfig`.
        licence: terms of the data, written into the exported file.
        attribution: source of the data to be named, written into the exported file.
    """

    name: str = "model"
    network: str = "mtp-go"
    seed: int = option(1, low=0, high=LARGEST_SEED)
    num_threads: int = option(2, low=0, high=LARGEST_THREADS)
    data: DataConfig = field(default_factory=DataConfig)
    history: HistoryConfig = field(default_factory=HistoryConfig)
    scene: SceneConfig = field(default_factory=SceneConfig)
    model: dict[str, Any] = field(default_factory=dict)
    optimisation: OptimisationConfig = OptimisationConfig()
    trainer: TrainerConfig = TrainerConfig()
    crossval: CrossvalConfig = field(default_factory=CrossvalConfig)
    licence: str = ""
    attribution: str = ""

    def __post_init__(self) -> None:
        check_options(self)
        classes = self.scene.classes
        known = set(classes) <= set(CLASSES) and len(set(classes)) == len(classes)
        require("scene.classes", list(classes), known, f"each once of {listed(CLASSES)}")


def load_config(path: Path, settings: Sequence[str] = ()) -> TrainingConfig:
    """Read a configuration from a YAML file.

    The file's ``base`` may list other files, whose values it takes where it has none of its own.

    Args:
        path: the file, see :func:`mtpgo_training.training.recipes.named_configs.find_config`.
        settings: ``KEY=VALUE`` each, a dotted path and a YAML value, which override the file.

    Raises:
        ConfigurationError: the file cannot be read, is not a YAML mapping, or has an unknown
            field or a value of the wrong type; the message names the file and the field.
    """
    data = _read(path)
    for setting in settings:
        data = _with_setting(data, setting)
    if isinstance(data, dict) and "data" in data:
        data = {**data, "data": with_preset(data["data"])}
    return from_dict(TrainingConfig, data, f"{path} with --set" if settings else str(path))


def _read(path: Path, inside: tuple[Path, ...] = ()) -> Any:
    """Return the plain data of a file, on top of those of the files in its ``base``.

    Raises:
        ConfigurationError: a file cannot be read, or is its own base.
    """
    try:
        data = parse_yaml(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigurationError(
            f"the configuration {path} cannot be read: {error.strerror}"
        ) from error
    except ModuleNotFoundError:  # PyYAML
        raise
    except Exception as error:  # a value that is not of its tag fails PyYAML in many ways
        reason = " ".join(str(error).split())
        raise ConfigurationError(f"the configuration {path} is no YAML: {reason}") from error
    if not isinstance(data, dict) or "base" not in data:
        return {} if data is None else data
    names, inside = data.pop("base"), (*inside, path.resolve())
    texts = isinstance(names, list) and all(isinstance(name, str) for name in names)
    require(f"base in {path}", names, texts, "a list of files, without .yaml, seen from this one")
    merged: Any = {}
    for name in names:
        other = path.parent / f"{name}.yaml"
        if other.resolve() in inside:
            raise ConfigurationError(f"base in {path} names {name!r}, which is based on this file")
        merged = _merged(merged, _read(other, inside))
    return _merged(merged, data)


def _merged(first: Any, other: Any) -> Any:
    """Return plain data with those of ``other`` put over them, mapping by mapping."""
    if not (isinstance(first, dict) and isinstance(other, dict)):
        return other
    both = {key: _merged(first[key], other[key]) for key in first.keys() & other.keys()}
    return {**first, **other, **both}


def _with_setting(data: Any, setting: str) -> Any:
    """Return plain data with one ``KEY=VALUE`` set.

    Raises:
        ConfigurationError: it is not such a pair or not YAML, or a part of its key is not a
            mapping.
    """
    key, equals, text = setting.partition("=")
    try:
        value = parse_yaml(text)
    except ModuleNotFoundError:
        raise
    except Exception:  # as above
        equals = ""
    if not (key and equals):
        raise ConfigurationError(f"--set is given {setting!r}, expected KEY=VALUE in YAML")

    def placed(inside: Any, path: list[str]) -> Any:
        if not path:
            return value
        if not isinstance(inside, dict):
            raise ConfigurationError(
                f"--set {setting!r} names the field {path[0]!r} of {inside!r}, which has none"
            )
        return {**inside, path[0]: placed(inside.get(path[0], {}), path[1:])}

    return placed(data, key.split("."))


def dump_config(config: TrainingConfig) -> str:
    """Return YAML text from which :func:`load_config` reads the same configuration."""
    return dump_yaml(_plain(dataclasses.asdict(config)))


def _plain(value: Any) -> Any:
    """Return tuples as lists, which YAML can write."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value
