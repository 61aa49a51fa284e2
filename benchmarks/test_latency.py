# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The exported model is faster than a straightforward implementation by a minimum ratio."""

import pytest
import torch

from mtpgo_training.benchmark.latency_benchmark import exported, make_model, make_scene
from mtpgo_training.benchmark.reference_mtp_go import ReferenceMTPGO


@pytest.mark.parametrize(("agents", "least"), [(8, 15.0), (16, 11.0), (32, 8.0), (64, 7.0)])
def test_one_prediction_keeps_its_ratio(in_turns, agents: int, least: float) -> None:
    model = make_model()
    scene = make_scene(agents, model.config)
    ours, plain = exported(model), ReferenceMTPGO(model.config, model.state_dict())

    def fast() -> None:
        with torch.inference_mode(), torch.jit.optimized_execution(False):
            ours(*scene)

    assert in_turns(fast, lambda: plain(*scene), rounds=30) >= least
