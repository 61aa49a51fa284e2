# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

from mtpgo_core.schema import AgentClass
from mtpgo_training.evaluation.honesty.road_user_groups import CLASS_GROUPS, class_group


def test_every_class_has_a_group():
    assert {class_group(kind) for kind in AgentClass} == set(CLASS_GROUPS)
    assert class_group(AgentClass.MOTORCYCLE) == class_group(AgentClass.VAN) == "vehicles"
    assert class_group(AgentClass.BICYCLE) == "bicycles"
