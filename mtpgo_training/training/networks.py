# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The networks that ``mtpgo train`` knows, by name."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from torch import Tensor, nn

from models.baselines import (
    ConvolutionalSocialLSTM,
    GraphConfig,
    GraphRNN,
    GridConfig,
    MMTransformer,
    RecurrentConfig,
    Seq2Seq,
    SocialLSTM,
    TrajectronConfig,
    TrajectronPlusPlus,
    TransformerConfig,
)
from models.inference import deployable
from models.mtp_go import MTPGO
from models.mtp_go_config import ModelConfig
from models.network_config import NetworkConfig
from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.scene.trails.trail_branches import BRANCHES
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig
from mtpgo_training.training.losses.latent_loss import latent_loss
from mtpgo_training.training.losses.region_loss import region_loss

WHEELED = ("car", "van", "truck", "bus", "trailer", "motorcycle", "bicycle")
"""Classes that move as unicycles in Trajectron++."""


def _unchanged(model: nn.Module) -> nn.Module:
    return model


@dataclass(frozen=True)
class OwnObjective:
    """A published training objective that replaces the schedule of EWTA and likelihood.

    Attributes:
        name: in the log.
        loss: of a dense batch, a scalar averaged over its observed agent-steps; called with the
            network, the batch, and by name ``progress``, the share of the epochs that are done,
            and ``huber``, the Huber losses to be added.
    """

    name: str
    loss: Callable[..., Tensor]


@dataclass(frozen=True)
class NetworkFamily:
    """A kind of network.

    Attributes:
        config: its options.
        network: creates one from its options.
        deployed: converts one into the form that is exported.
        objective: its own, if it is not trained by the common schedule.
    """

    config: type[NetworkConfig]
    network: Callable[[Any], TrajectoryPredictor]
    deployed: Callable[[Any], nn.Module] = _unchanged
    objective: OwnObjective | None = None


MTP_GO = "mtp-go"

NETWORKS: dict[str, NetworkFamily] = {
    MTP_GO: NetworkFamily(ModelConfig, MTPGO, deployable),
    "seq2seq": NetworkFamily(RecurrentConfig, Seq2Seq),
    "s-lstm": NetworkFamily(GridConfig, SocialLSTM),
    "cs-lstm": NetworkFamily(GridConfig, ConvolutionalSocialLSTM),
    "gnn-rnn": NetworkFamily(GraphConfig, GraphRNN),
    "mmtransformer": NetworkFamily(
        TransformerConfig, MMTransformer, objective=OwnObjective("regions", region_loss)
    ),
    "trajectron++": NetworkFamily(
        TrajectronConfig, TrajectronPlusPlus, objective=OwnObjective("ELBO", latent_loss)
    ),
}
"""MTP-GO, and the baselines of :mod:`models.baselines`."""


def family(name: str) -> NetworkFamily:
    """Return the kind of network with this name.

    Raises:
        ConfigurationError: there is none.
    """
    if name not in NETWORKS:
        raise ConfigurationError(
            f"network is {name!r}, expected one of {', '.join(repr(n) for n in NETWORKS)}"
        )
    return NETWORKS[name]


def network_config(
    name: str, options: Mapping[str, Any], history: HistoryConfig, scene: SceneConfig
) -> NetworkConfig:
    """Return a network's configuration: ``options`` and the sizes that follow from the task.

    Args:
        name: of the network.
        options: fields of its configuration.
        history: determines the number of steps and their length.
        scene: determines the features and classes.

    Raises:
        ConfigurationError: no network has this name, or it does not have an option or rejects a
            value.
    """
    kind = family(name)
    if scene.angles == "radians" and options.get("agent_frame", True):
        raise ConfigurationError(
            "scene.angles is 'radians' and model.agent_frame True, expected 'vector' or "
            "agent_frame=False: own frames need the yaw as cosine and sine"
        )
    sizes: dict[str, Any] = {
        "feature_size": len(scene.features),
        "static_size": len(scene.static_features),
        "history_steps": history.steps,
        "dt_s": history.dt_s,
    }
    if "trail_branches" in kind.config.names():
        sizes["trail_branches"] = BRANCHES if scene.trails else 0
    if "yaw_as_angle" in kind.config.names():
        sizes["yaw_as_angle"] = scene.angles == "radians"
    if "wheeled_columns" in kind.config.names():
        sizes["wheeled_columns"] = tuple(
            column for column, name in enumerate(scene.classes) if name in WHEELED
        )
    return kind.config.from_dict({**options, **sizes})


def build_network(
    name: str, options: Mapping[str, Any], history: HistoryConfig, scene: SceneConfig
) -> TrajectoryPredictor:
    """Return a new network with random weights; arguments as in :func:`network_config`."""
    return family(name).network(network_config(name, options, history, scene))


def options_for(name: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return those of another network's options that ``name`` has too.

    This way all networks can be trained with one configuration. An option that no network has is
    kept, and rejected when the network is built.

    Raises:
        ConfigurationError: no network has this name.
    """
    own = family(name).config.names()
    others = {option for kind in NETWORKS.values() for option in kind.config.names()}
    return {key: value for key, value in options.items() if key in own or key not in others}


def rebuild(name: str, options: Mapping[str, Any]) -> TrajectoryPredictor:
    """Return a network built from its whole configuration, as stored in a checkpoint.

    Raises:
        ConfigurationError: no network has this name, or an option is unknown or not allowed.
    """
    kind = family(name)
    return kind.network(kind.config.from_dict(dict(options)))


def name_of(model: TrajectoryPredictor) -> str:
    """Return the name of ``model`` in :data:`NETWORKS`."""
    return next(name for name, kind in NETWORKS.items() if kind.network is type(model))


def horizon_steps(options: Mapping[str, Any]) -> int:
    """Return the predicted steps of a network with these options, the section ``model``."""
    return int(options.get("horizon_steps", NetworkConfig.horizon_steps))


def parameter_count(model: nn.Module) -> int:
    """Return the number of a network's parameters, frozen ones included."""
    return sum(parameter.numel() for parameter in model.parameters())


def weights_hash(model: nn.Module) -> str:
    """Return the SHA-256 over the names and values of all parameters and buffers."""
    digest = hashlib.sha256()
    for name, value in sorted(model.state_dict().items()):
        digest.update(name.encode())
        digest.update(value.detach().cpu().contiguous().numpy().tobytes())
    return digest.hexdigest()
