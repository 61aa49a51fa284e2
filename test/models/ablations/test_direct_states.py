# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The decoder's own states."""

import pytest
import torch
from motion_samples import B, M, N, make_start

from models import ModelConfig
from models.ablations.direct_states import DirectStates


@pytest.mark.parametrize("order", [1, 2])
def test_direct_states_are_differences_from_uniform_motion(order):
    direct = DirectStates(ModelConfig(order=order, ekf=False, ode=False))
    start = make_start()
    control = torch.randn(B, N, M, 2 * order).double()
    state = direct(control, start, 5)
    uniform = start.position + start.velocity * 1.0
    if order == 2:
        uniform = torch.cat((uniform, start.velocity), dim=-1)
    torch.testing.assert_close(state - uniform.unsqueeze(2), control)
