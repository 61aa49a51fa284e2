# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The exported form computes what the model computes."""

import pytest
import torch
from model_samples import BEYOND_PAPER, frozen, inputs_for, make_model, make_scene

from models.inference import FastMTPGO, deployable

COVERED = {
    "default": {},
    "gat": {"layer": "gat"},
    "untied": {"tied": False},
    "static": {"static_features": True},
    "heun, paper's G": {"integrator": "heun", "noise_input": "velocity"},
    "euler, configured P_0": {"integrator": "euler", "initial_covariance": "configured"},
    "calibrated": {"observation_std_m": 0.2, "covariance_scale": 1.3},
    "context": {"feature_size": 11},
    "static features in the encoder": {"static_features": True, "static_inputs": "all"},
    "trails": {"trail_branches": 3},
    "held": {"hold_standing": True},
    "settles": {"settle_standing": True},
    "favours staying": {"stay_bias": 0.6},
    "heaviest moved": {"heaviest_kernels": (0.0, 2.0)},
    "beyond the paper": BEYOND_PAPER,
    "beyond the paper, twelve steps": {**BEYOND_PAPER, "horizon_steps": 12},
}
NOT_COVERED = (
    {"order": 1},
    {"layer": "gcn"},
    {"heads": 2},
    {"gnn_layers": 2},
    {"ode_layers": 2},
    {"encoder_gnn": False},
    {"decoder_gnn": False},
    {"ekf": False},
    {"agent_frame": False},
)


@pytest.mark.parametrize("agents", [1, 7])
@pytest.mark.parametrize("name", COVERED)
@torch.no_grad()
def test_same_numbers_as_the_model(name, agents):
    model = make_model(**COVERED[name])
    scene = make_scene(2, agents, steps=6, size=model.config.feature_size)
    fast = deployable(model)
    assert isinstance(fast, FastMTPGO)
    inputs = inputs_for(model, scene)
    for got, want in zip(fast(*inputs), model(*inputs), strict=True):
        here = scene.present
        torch.testing.assert_close(got[here], want[here], rtol=1e-9, atol=1e-9)


@torch.no_grad()
def test_given_initial_covariances():
    model = make_model()
    scene = make_scene(1, 4, steps=6, odd=False)
    root = torch.randn(1, 4, 4, 4).double()
    initial = root @ root.transpose(-1, -2) + torch.eye(4)
    initial[0, 2, 1, 1] = float("nan")
    fast = frozen(model)
    want = model(*scene.inputs(), initial)
    for got, expected in zip(fast(*scene.inputs(), initial), want, strict=True):
        torch.testing.assert_close(got, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("choices", [{}, BEYOND_PAPER], ids=str)
@torch.no_grad()
def test_single_precision_at_driving_speeds(choices):
    """The size that is exported, in float32: within a tenth of the 1e-4 m that is allowed."""
    sizes = {"history_steps": 16, "horizon_steps": 25, "modes": 8, "hidden": 64}
    model = make_model(torch.float32, wild=False, **sizes, **choices)
    model.motion.last.normal_(0.0, 0.1)
    scene = make_scene(1, 24, dtype=torch.float32)
    inputs = inputs_for(model, scene)
    want, got = model(*inputs), frozen(model)(*inputs)
    here = scene.present
    # Scene coordinates reach a hundred metres, where float32 has steps of 8e-6 m.
    torch.testing.assert_close(got[1][here], want[1][here], rtol=0, atol=5e-5)
    torch.testing.assert_close(got[2][here], want[2][here], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("choices", NOT_COVERED, ids=str)
def test_other_models_are_exported_as_they_are(choices):
    model = make_model(**choices)
    assert deployable(model) is model


def test_weights_are_copied_out_of_the_graph():
    """No buffer of the fast form requires a gradient."""
    fast = deployable(make_model())
    assert all(not buffer.requires_grad for buffer in fast.buffers())
