# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the rows of a study cost: parameters, and the time of a training."""

from __future__ import annotations

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.study.study_rows import Study, row_config
from mtpgo_training.table_format import Row, Table
from mtpgo_training.training.networks import build_network, parameter_count


def costs_table(study: Study) -> Table:
    """Return for each row its name, its parameters, and how it departs from its recipe.

    Args:
        study: which one.
    """
    rows = []
    for row in study.rows:
        if not row.is_trained:
            rows.append(Row(row.name, [row.title, "-", "nothing to train"]))
            continue
        try:
            config = row_config(row, study.data_sets[-1], None, ())
        except ConfigurationError as error:
            rows.append(Row(row.name, [row.title, "-", f"cannot be trained: {error}"]))
            continue
        model = build_network(config.network, config.model, config.history, config.scene)
        rows.append(
            Row(row.name, [row.title, str(parameter_count(model)), " ".join(row.settings) or "-"])
        )
    return Table(["row", "title", "parameters", "departs from the recipe by"], rows)
