# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The networks that ``mtpgo train`` knows, by name."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from torch import nn

from models.baselines import (
    ConvolutionalSocialLSTM,
    GraphConfig,
    GraphRNN,
    GridConfig,
    RecurrentConfig,
    Seq2Seq,
    SocialLSTM,
)
from models.inference import deployable
from models.mtp_go import MTPGO
from models.mtp_go_config import ModelConfig
from models.network_config import NetworkConfig
from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig


def _as_it_is(model: nn.Module) -> nn.Module:
    return model


@dataclass(frozen=True)
class NetworkFamily:
    """One kind of network.

    Attributes:
        config: its options.
        network: makes one of its options.
        deployed: the form of one that is exported.
    """

    config: type[NetworkConfig]
    network: Callable[[Any], TrajectoryPredictor]
    deployed: Callable[[Any], nn.Module] = _as_it_is


MTP_GO = "mtp-go"

NETWORKS: dict[str, NetworkFamily] = {
    MTP_GO: NetworkFamily(ModelConfig, MTPGO, deployable),
    "seq2seq": NetworkFamily(RecurrentConfig, Seq2Seq),
    "s-lstm": NetworkFamily(GridConfig, SocialLSTM),
    "cs-lstm": NetworkFamily(GridConfig, ConvolutionalSocialLSTM),
    "gnn-rnn": NetworkFamily(GraphConfig, GraphRNN),
}
"""MTP-GO, and the baselines of :mod:`models.baselines`."""


def family(name: str) -> NetworkFamily:
    """The network called ``name``.

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
    """A network's configuration: ``options`` with the sizes that follow from the task.

    Args:
        name: of the network.
        options: fields of its configuration.
        history: the task's, gives the number of steps and their length.
        scene: the task's, gives the features and classes.

    Raises:
        ConfigurationError: no network has this name, or it does not know an option or refuses a
            value.
    """
    kind = family(name)
    sizes = {
        "feature_size": len(scene.features),
        "static_size": len(scene.classes),
        "history_steps": history.steps,
        "dt_s": history.dt_s,
    }
    try:
        return kind.config.from_dict({**options, **sizes})
    except ValueError as error:
        raise ConfigurationError(f"model: {error}") from error


def build_network(
    name: str, options: Mapping[str, Any], history: HistoryConfig, scene: SceneConfig
) -> TrajectoryPredictor:
    """A new network with random weights; arguments and errors as :func:`network_config`."""
    return family(name).network(network_config(name, options, history, scene))


def options_for(name: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """What of another network's options ``name`` can be built with.

    So one configuration serves to train all networks on the same data: options that others know
    and this one does not are left out. One that nobody knows stays and is refused when the network
    is built.

    Raises:
        ConfigurationError: no network has this name.
    """
    own = family(name).config.names()
    others = {option for kind in NETWORKS.values() for option in kind.config.names()}
    return {key: value for key, value in options.items() if key in own or key not in others}


def rebuild(name: str, options: Mapping[str, Any]) -> TrajectoryPredictor:
    """A network from its whole configuration, as a checkpoint holds it.

    Raises:
        ConfigurationError: no network has this name.
        ValueError: see :meth:`models.network_config.NetworkConfig.from_dict`.
    """
    kind = family(name)
    return kind.network(kind.config.from_dict(dict(options)))


def name_of(model: TrajectoryPredictor) -> str:
    """The name under which ``model`` is in :data:`NETWORKS`."""
    return next(name for name, kind in NETWORKS.items() if kind.network is type(model))


def weights_hash(model: nn.Module) -> str:
    """SHA-256 over the names and values of all parameters and buffers."""
    digest = hashlib.sha256()
    for name, value in sorted(model.state_dict().items()):
        digest.update(name.encode())
        digest.update(value.detach().cpu().contiguous().numpy().tobytes())
    return digest.hexdigest()
