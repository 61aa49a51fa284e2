# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What all networks share: teacher forcing and the covariance of observed states."""

import pytest
import torch

from models.network_config import NetworkConfig
from models.trajectory_predictor import TrajectoryPredictor

STATE = torch.zeros(1, 2, 3, 2)  # two agents, three modes
TEACHER = torch.tensor([[[[1.0, 2.0], [3.0, 4.0]], [[5.0, 6.0], [7.0, 8.0]]]])
KNOWN = torch.tensor([[[True, False], [True, True]]])


def predictor(**choices):
    return TrajectoryPredictor(NetworkConfig(**choices))


def test_the_decoder_sees_the_true_state_of_the_step_before_in_all_modes():
    seen = predictor().seen(STATE, TEACHER, KNOWN, 2)
    assert seen[0, 0].tolist() == [[0.0, 0.0]] * 3  # unknown at the second step: its own
    assert seen[0, 1].tolist() == [[7.0, 8.0]] * 3


def test_the_first_step_sees_the_state_at_t():
    assert predictor().seen(STATE, TEACHER, KNOWN, 0) is STATE


@pytest.mark.parametrize(("teacher", "known"), [(None, None), (TEACHER, None), (None, KNOWN)])
def test_without_a_teacher_the_decoder_sees_its_own_predictions(teacher, known):
    assert predictor().seen(STATE, teacher, known, 2) is STATE


def test_observed_covariances_by_hand():
    """1.5 (P + 0.2^2 I) of P = [[1, 0.5], [0.5, 2]] m^2."""
    covariance = torch.tensor([[1.0, 0.5], [0.5, 2.0]])
    observed = predictor(observation_std_m=0.2, covariance_scale=1.5).observed(covariance)
    torch.testing.assert_close(observed, torch.tensor([[1.56, 0.75], [0.75, 3.06]]))


def test_the_observation_noise_is_no_part_of_a_checkpoint():
    """It belongs to the configuration, so a changed one is not overwritten by loading weights."""
    assert "observation" not in predictor(observation_std_m=0.2).state_dict()


def test_a_network_has_to_implement_the_roll_out():
    with pytest.raises(NotImplementedError):
        predictor()(torch.zeros(1, 1, 16, 8), torch.ones(1, 1, 16).bool(), torch.zeros(1, 1, 8))
