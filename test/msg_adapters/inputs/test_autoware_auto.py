# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The earlier Autoware message: the same content in another order of bytes."""

import numpy as np

from msg_adapters.inputs.autoware import PACKAGE
from msg_adapters.inputs.autoware_auto import PACKAGE_AUTO
from msg_adapters.registry import INPUTS, adapter_for_type

AUTO, LATER = INPUTS["autoware_auto"], INPUTS["autoware"]


def test_round_trip(states, offline, decoded, assert_equal):
    message = AUTO.from_states(states, offline)
    for found in decoded(message, AUTO.message_type).values():
        read, later = AUTO.to_states(found), LATER.to_states(LATER.from_states(states, offline))
        assert_equal(read, later)


def test_the_availability_of_the_orientation_comes_after_the_pose(states, offline, typestore):
    fields = {
        package: [name for name, _ in typestore.fielddefs[package + "TrackedObjectKinematics"][1]]
        for package in (PACKAGE, PACKAGE_AUTO)
    }
    assert fields[PACKAGE_AUTO].index("orientation_availability") == 1
    assert fields[PACKAGE].index("orientation_availability") == 3
    assert sorted(fields[PACKAGE]) == sorted(fields[PACKAGE_AUTO])
    # A byte there shifts all that follows: read as the later message, it would be another one.
    message = AUTO.from_states(states, offline)
    data = bytes(typestore.serialize_cdr(message, AUTO.message_type))
    assert data != bytes(
        typestore.serialize_cdr(LATER.from_states(states, offline), LATER.message_type)
    )
    assert np.isfinite(AUTO.to_states(message).velocity).any()


def test_the_type_selects_it():
    assert adapter_for_type("autoware_auto_perception_msgs/TrackedObjects") is AUTO
