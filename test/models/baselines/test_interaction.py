# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The interaction of a network without neighbour features."""

from baseline_samples import crowd

from models.baselines.interaction import NoInteraction


def test_without_interaction_there_are_no_features():
    h, *where = crowd()
    interaction = NoInteraction()
    assert interaction(h, interaction.prepare(*where)).shape == (2, 9, 0)
