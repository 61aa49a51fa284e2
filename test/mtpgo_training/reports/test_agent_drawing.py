# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The shapes drawn for one road user."""

import dataclasses

import numpy as np
import pytest
from demo_traffic import make_recording, perfect_prediction
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Polygon

from mtpgo_core.class_size import CLASS_SIZE_M
from mtpgo_core.frames import rotate_covariance
from mtpgo_core.schema import AgentClass
from mtpgo_training.evaluation.moments import Moment
from mtpgo_training.reports import agent_drawing
from mtpgo_training.reports.local_view import surroundings


def drawn(agent, *, focal, **changes):
    """Draw a road user at 2 s, where both drive along +x, and return the axes."""
    recording = make_recording()
    prediction = dataclasses.replace(perfect_prediction(recording, 20), **changes)
    moment = Moment(recording, prediction, agent, 1.0)
    axes = Figure().add_subplot()
    agent_drawing.draw_agent(axes, moment, surroundings(moment, 2.0), agent, focal=focal)
    return axes


def body(axes):
    """Return the length and width of the body."""
    (polygon,) = (patch for patch in axes.patches if isinstance(patch, Polygon))
    return np.ptp(polygon.get_xy(), axis=0)


@pytest.mark.parametrize("angle", [0.0, 0.6, -1.2])
def test_an_ellipse_spans_two_standard_deviations_to_either_side(angle):
    axes = Figure().add_subplot()
    covariance = rotate_covariance(np.diag([4.0, 1.0]), angle)
    agent_drawing._draw_ellipse(axes, np.array([1.0, 2.0]), covariance, alpha=0.1, zorder=1)
    for patch in axes.patches:
        assert patch.center == (1.0, 2.0)
        assert (patch.width, patch.height) == pytest.approx((8.0, 4.0))
        assert (patch.angle - np.degrees(angle)) % 180.0 == pytest.approx(0.0, abs=1e-9) or (
            patch.angle - np.degrees(angle)
        ) % 180.0 == pytest.approx(180.0)


def test_a_body_without_a_size_has_that_of_its_class():
    np.testing.assert_allclose(body(drawn(0, focal=True)), [4.5, 1.9])  # its own
    np.testing.assert_allclose(body(drawn(1, focal=True)), CLASS_SIZE_M[AgentClass.TRUCK])
    walkers = np.full(2, AgentClass.PEDESTRIAN, dtype=np.uint8)
    np.testing.assert_allclose(body(drawn(1, focal=True, agent_class=walkers)), [0.5, 0.5])


def test_unlikely_modes_are_left_out():
    """An ellipse is two patches; five times ahead for the road user in focus, one for others."""

    def modes(weight, *, focal):
        axes = drawn(0, focal=focal, weight=np.tile(weight, (2, 1)))
        ellipses = sum(isinstance(patch, Ellipse) for patch in axes.patches)
        return ellipses / (2 * (len(agent_drawing.STEPS_S) if focal else 1))

    assert modes([0.95, 0.05], focal=True) == modes([0.85, 0.15], focal=False) == 2
    assert modes([0.96, 0.04], focal=True) == modes([0.86, 0.14], focal=False) == 1


def test_constant_velocity_is_drawn_for_the_road_user_in_focus_only():
    def ends(axes):
        return [
            line.get_xydata()[-1] for line in axes.lines if line.get_color() == agent_drawing.CV
        ]

    np.testing.assert_allclose(ends(drawn(1, focal=True)), [[50.0, 0.0]] * 2)
    assert ends(drawn(1, focal=False)) == []
