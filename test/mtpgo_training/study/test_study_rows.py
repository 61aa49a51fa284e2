# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rows are those of the paper's tables, and each has a configuration."""

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.study.paper_tables import PAPER, VALUES
from mtpgo_training.study.study_rows import STUDIES, row_config
from mtpgo_training.training.networks import NETWORKS


@pytest.mark.parametrize("study", STUDIES.values(), ids=list(STUDIES))
def test_every_row_of_the_paper_is_there_in_its_order(study):
    assert tuple(PAPER[study.name]) == study.data_sets
    for table in PAPER[study.name].values():
        assert list(table) == [row.name for row in study.rows]


@pytest.mark.parametrize("given", [None, "default"])
@pytest.mark.parametrize("study", STUDIES.values(), ids=list(STUDIES))
def test_every_row_has_a_configuration(study, given):
    for row in study.rows:
        if row.is_trained and row.network in NETWORKS:
            config = row_config(row, study.data_sets[-1], given, ("seed=3",))
            assert (config.network, config.seed) == (row.network, 3)


def test_recipes_set_order_and_classes():
    rows = {row.name: row for row in STUDIES["static"].rows}
    for given in (None, "default"):
        first = row_config(rows["mtp-go1"], "ind", given, ())
        second = row_config(rows["mtp-go2-s"], "ind", given, ())
        assert (first.model["order"], first.model["static_features"]) == (1, False)
        assert (second.model["order"], second.model["static_features"]) == (2, True)
        assert second.model["static_inputs"] == "motion"


def test_figures_of_the_ablation_have_half_widths():
    value = PAPER["ablation"]["highd"]["4"]["anll"]
    assert (value.value, value.half_width, str(value)) == (-1.76, 0.86, "-1.76 ± 0.86")
    assert set(PAPER["ablation"]["round"]["7"]) == set(VALUES)


def test_windows_that_the_losses_cannot_compare_are_refused():
    settings = ("data.stride_s=0.5",)
    with pytest.raises(ConfigurationError, match=r"data\.stride_s is 0\.5 but optimisation\.cons"):
        row_config(STUDIES["layers"].rows[0], "highd", "default", settings)


def test_an_unknown_configuration_is_refused():
    row = STUDIES["layers"].rows[0]
    with pytest.raises(ConfigurationError, match="expected a YAML file or one of"):
        row_config(row, "nuscenes", None, ())
