# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The security policy allows what the node uses, and files are chosen before it is active."""

import pytest
from policy_check import check_policy

from mtpgo_ros.parameters.predictor_parameters import Change, PredictorParameters

ON_DEMAND = {
    "~/predicted_objects": "with the output autoware",
    "~/health": "of supervision",
    "~/swap_model": "of supervision",
    "~/quality": "of the live scores",
    "~/quality_table": "of the live scores",
    "~/quality_markers": "of the live scores",
    "lane_markings": "of models with lanes",
    "odometry": "with fixed_frame",
    "tf": "with fixed_frame",
    "tf_static": "with fixed_frame",
    "clock": "with use_sim_time",
    "bond": "under a manager of the life cycle",
}
"""What the node does not use in every setting."""


@pytest.mark.parametrize("fixed_frame", ["", "map"])
def test_the_policy_allows_what_the_node_uses_and_nothing_else(bench, fixed_frame):
    check_policy(bench("default", fixed_frame=fixed_frame).node, ON_DEMAND)


def test_parameters_that_select_a_file_are_fixed_while_there_is_a_model():
    fields = PredictorParameters.__dataclass_fields__
    for name in ("model", "model_sha256"):
        assert fields[name].metadata["change"] is Change.CONFIGURE
