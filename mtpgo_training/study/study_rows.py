# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The four studies of the paper: their rows, and the configuration of each."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from mtpgo_core.errors import ConfigurationError, MtpgoError
from mtpgo_training.study.paper_tables import CLASS_VALUES, CLASSES, VALUES
from mtpgo_training.training.networks import MTP_GO, options_for
from mtpgo_training.training.recipes.named_configs import find_config
from mtpgo_training.training.run_loss import trainable_network
from mtpgo_training.training.training_config import TrainingConfig, load_config


class StudyError(MtpgoError):
    """A study without any result."""


_NO_CLASSES = ("model.static_features=false", "model.heaviest_kernels=[]")
_CLASSES = (
    "model.static_features=true",
    "model.static_inputs=motion",
    "model.heaviest_kernels=[]",
)
RECIPES = {
    "mtp-go1": ("model.order=1", *_NO_CLASSES),
    "mtp-go1-s": ("model.order=1", *_CLASSES),
    "mtp-go2": ("model.order=2", *_NO_CLASSES),
    "mtp-go2-s": ("model.order=2", *_CLASSES),
}
"""The paper's methods by name. With the data set appended they are the names of the paper's own
configurations; the values make them of any other one."""


@dataclass(frozen=True)
class StudyRow:
    """A row of a table.

    Attributes:
        name: by which it is chosen.
        title: in the tables.
        recipe: a key of :data:`RECIPES`, empty for a baseline without training.
        network: in :data:`mtpgo_training.training.networks.NETWORKS`.
        settings: values by which it departs from the recipe.
        removed: of an ablation, what it goes without.
    """

    name: str
    title: str
    recipe: str = "mtp-go2"
    network: str = MTP_GO
    settings: tuple[str, ...] = ()
    removed: str = ""

    @property
    def is_trained(self) -> bool:
        """Whether there is something to train."""
        return self.recipe != ""


@dataclass(frozen=True)
class Study:
    """One of the paper's studies.

    Attributes:
        name: of the study.
        data_sets: of the paper, for which it has figures.
        columns: values of a row, ``CLASS.VALUE`` of one class.
        rows: in the order of the paper.
        policy: graph policy of the scores: ``each`` scores every road user as the centre of its
            graph, as the paper compares methods; None: all road users in the node's graphs.
        classes: road users that the data must have.
    """

    name: str
    data_sets: tuple[str, ...]
    columns: tuple[str, ...]
    rows: tuple[StudyRow, ...]
    policy: str | None = None
    classes: tuple[str, ...] = ()

    def chosen(self, names: Sequence[str] | None) -> list[StudyRow]:
        """Return the rows with these names, all for None, in the order of the paper.

        Raises:
            ConfigurationError: there is no row of a name.
        """
        known = [row.name for row in self.rows]
        for name in names or ():
            if name not in known:
                raise ConfigurationError(
                    f"--rows names {name!r}, expected of the study {self.name} some of "
                    + ", ".join(known)
                )
        return [row for row in self.rows if names is None or row.name in names]


def _baseline(name: str, title: str) -> StudyRow:
    return StudyRow(name, title, recipe="")


_CA = _baseline("ca", "CA")
_CV = _baseline("cv", "CV")


def _layer(layer: str, title: str, heads: int = 0) -> StudyRow:
    if not heads:
        return StudyRow(layer, title, settings=(f"model.layer={layer}",))
    settings = (f"model.layer={layer}", f"model.heads={heads}")
    return StudyRow(
        f"{layer}-{heads}", f"{title} ({heads} head{'s' * (heads > 1)})", settings=settings
    )


def _ablation(name: str, *removed: str) -> StudyRow:
    text = ", ".join(_REMOVED[part] for part in removed)
    settings = tuple(f"model.{part}=false" for part in removed)
    return StudyRow(
        name, f"{name}: {f'no {text}' if text else 'all'}", settings=settings, removed=text
    )


_REMOVED = {
    "encoder_gnn": "encoder GNN",
    "decoder_gnn": "decoder GNN",
    "ekf": "EKF",
    "ode": "ODE",
}

STUDIES = {
    study.name: study
    for study in (
        Study(
            "layers",
            ("highd", "round"),
            VALUES,
            (
                _layer("graphconv", "GraphConv"),
                _layer("gcn", "GCN"),
                *(_layer("gat", "GAT", heads) for heads in (1, 3, 5)),
                *(_layer("gat+", "GAT+", heads) for heads in (1, 3, 5)),
            ),
        ),
        Study(
            "static",
            ("ind",),
            CLASS_VALUES,
            (
                _CA,
                _CV,
                StudyRow("mtp-go1", "MTP-GO1", "mtp-go1"),
                StudyRow("mtp-go1-s", "MTP-GO1-S", "mtp-go1-s"),
                StudyRow("mtp-go2", "MTP-GO2", "mtp-go2"),
                StudyRow("mtp-go2-s", "MTP-GO2-S", "mtp-go2-s"),
            ),
            classes=CLASSES,
        ),
        Study(
            "comparison",
            ("highd", "round"),
            VALUES,
            (
                _CA,
                _CV,
                StudyRow("seq2seq", "Seq2Seq", network="seq2seq"),
                StudyRow("s-lstm", "S-LSTM", network="s-lstm"),
                StudyRow("cs-lstm", "CS-LSTM", network="cs-lstm"),
                StudyRow("gnn-rnn", "GNN-RNN", network="gnn-rnn"),
                StudyRow("mmtransformer", "mmTransformer", network="mmtransformer"),
                StudyRow("trajectron++", "Trajectron++", network="trajectron++"),
                StudyRow("mtp-go1", "MTP-GO1", "mtp-go1"),
                StudyRow("mtp-go2", "MTP-GO2", "mtp-go2"),
            ),
            policy="each",
        ),
        Study(
            "ablation",
            ("highd", "round"),
            VALUES,
            (
                _ablation("1"),
                _ablation("2", "encoder_gnn"),
                _ablation("3", "decoder_gnn"),
                _ablation("4", "ekf"),
                _ablation("5", "ekf", "ode"),
                _ablation("6", "encoder_gnn", "decoder_gnn"),
                _ablation("7", "encoder_gnn", "decoder_gnn", "ekf"),
            ),
        ),
    )
}
"""By name."""


def find_study(name: str) -> Study:
    """Return the study of a name.

    Raises:
        ConfigurationError: there is none.
    """
    if name not in STUDIES:
        raise ConfigurationError(f"the study is {name!r}, expected one of {', '.join(STUDIES)}")
    return STUDIES[name]


def row_config(
    row: StudyRow, data_set: str, given: str | None, settings: Sequence[str]
) -> TrainingConfig:
    """Return the configuration of a row.

    Args:
        row: the row.
        data_set: of the paper, whose configurations are taken by default.
        given: file or name of a configuration that all rows begin with, None for the paper's.
        settings: ``KEY=VALUE``, for all rows.

    Raises:
        ConfigurationError: there is no such configuration, network or option.
    """
    if given is None:
        path, own = find_config(f"{row.recipe}-{data_set}"), row.settings
    else:
        path, own = find_config(given), (*RECIPES[row.recipe], *row.settings)
    config = load_config(path, [*own, *settings])
    if row.network != config.network:
        options = options_for(row.network, config.model)
        config = dataclasses.replace(config, network=row.network, model=options)
    config = dataclasses.replace(
        config,
        name=row.name,
        trainer=dataclasses.replace(
            config.trainer, devices=1, num_nodes=1, strategy="auto", loader_workers=0
        ),
    )
    trainable_network(config)
    return config
