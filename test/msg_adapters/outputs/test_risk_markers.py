# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Markers coloured by risk."""

import dataclasses

import numpy as np
import pytest

from msg_adapters.outputs.marker_encoding import DELETE
from msg_adapters.outputs.marker_tracker import MarkerTracker
from msg_adapters.outputs.risk_markers import (
    BOXES,
    LABELS,
    PLAN,
    UNKNOWN_COLOUR,
    WAYS,
    draw_risk,
    risk_colour,
)
from mtpgo_core.frames import Pose2
from mtpgo_core.prediction.output_assembly import select
from mtpgo_core.risk.collision_risk import assess
from mtpgo_core.risk.ego_plan import EgoFootprint, plan_of_motion

BOX = EgoFootprint(length=60.0, width=40.0)


@pytest.fixture
def plan(prediction):
    return plan_of_motion(prediction.stamp_ns, "map", Pose2(0.0, 0.0, 0.0, velocity=(9.0, 0.0)))


def test_colours_go_from_green_to_red_and_unknown_is_none_of_them():
    red, green, _ = zip(*(risk_colour(p) for p in (0.0, 0.05, 0.5)), strict=True)
    assert red[0] < 0.3
    assert green[0] > 0.6
    assert green[2] < 0.2
    assert risk_colour(1.0) == risk_colour(0.5)
    assert risk_colour(float("nan")) == UNKNOWN_COLOUR
    assert UNKNOWN_COLOUR not in [risk_colour(p) for p in np.linspace(0.0, 1.0, 101)]


def test_ways_boxes_labels_and_plan_are_drawn_in_the_colour_of_the_risk(prediction, plan):
    risk = assess(prediction, plan, BOX)
    drawn = draw_risk(risk, MarkerTracker(), plan, BOX)
    by_kind = {ns: [m for m in drawn if m.ns == ns] for ns in (WAYS, BOXES, LABELS, PLAN)}
    assert [len(by_kind[ns]) for ns in (WAYS, BOXES, PLAN)] == [3, 3, 2]
    worst = int(risk.peak.argmax())
    assert by_kind[BOXES][worst].colour[:3] == risk_colour(risk.peak[worst])
    assert by_kind[BOXES][worst].scale[:2] == tuple(risk.size[worst])
    assert f"{risk.peak[worst]:.0%} in" in {m.text[: m.text.find(" in") + 3] for m in drawn}
    assert all(np.isfinite(m.points).all() for m in drawn)


def test_an_unknown_risk_is_drawn_as_unknown(prediction):
    drawn = draw_risk(assess(prediction, None, BOX), MarkerTracker())
    assert {m.colour[:3] for m in drawn} == {UNKNOWN_COLOUR}
    assert {m.text for m in drawn if m.ns == LABELS} == {"risk unknown"}


def test_what_is_not_finite_is_not_drawn_and_what_is_gone_is_deleted(prediction, plan):
    tracker = MarkerTracker()
    first = draw_risk(assess(prediction, plan, BOX), tracker)
    lost = dataclasses.replace(prediction, mean=prediction.mean.copy())
    lost.mean[0] = np.nan
    drawn = draw_risk(assess(lost, plan, BOX), tracker)
    gone = {(m.ns, m.number) for m in drawn if m.action == DELETE}
    assert {ns for ns, _ in gone} >= {WAYS, BOXES}
    rest = draw_risk(assess(select(prediction, np.array([1])), plan, BOX), tracker)
    assert len([m for m in rest if m.action == DELETE]) > 0
    assert len(first) > len(rest)
