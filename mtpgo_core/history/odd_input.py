# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The counters of unusual input: the node counts them live, the readers of bags offline."""

from __future__ import annotations

from collections.abc import Mapping

ODD_INPUT: dict[str, str] = {
    "malformed": "messages that could not be read",
    "skipped_objects": "objects that could not be read",
    "non_finite": "objects without a finite position",
    "too_fast": "objects faster than possible",
    "duplicate_keys": "identities twice in a message",
    "duplicates": "objects with a repeated stamp",
    "late": "objects older than what is known",
    "behind": "objects too far behind the newest stamp to be predicted, as of two publishers with"
    " different clocks",
    "restarted": "tracks restarted after an impossible move, as of an identity that is used again"
    " or by two publishers",
    "alternating": "objects that alternate between two places, as of two publishers with the same"
    " identities",
    "left_out": "objects left out, beyond the nearest max_tracks",
    "dropped": "tracks dropped for lack of room",
    "unstamped": "messages without a stamp",
    "stamp_unit": "messages whose stamps are all in the first millisecond of a second, as with"
    " microseconds or milliseconds in the field of nanoseconds",
    "stamp_pace": "messages whose stamps advance less than a hundredth as fast as the clock, as in"
    " another unit: hardly any prediction is due",
    "future_stamp": "messages ahead of the clock",
    "clock_reset": "jumps of the clock backwards",
    "clock_set": "times that the clock of this machine or of the objects was set",
    "frame_changed": "messages in another frame",
    "wrong_frame": "objects in another frame",
    "not_lifted": "messages that could not be transformed into the fixed frame",
    "odometry_refused": "messages of the odometry that could not be used",
    "ego_missing": "messages at whose time the ego's odometry was not known",
    "ego_refused": "messages of the ego's odometry that could not be used",
    "qos_incompatible": "publishers with an incompatible QoS",
    "messages_lost": "messages lost by the middleware",
    "input_overruns": "messages replaced by newer ones before they could be decoded",
    "delay_not_compensated": "delays too long to be compensated",
}
"""Counters of unusual input and their descriptions."""


def described(counts: Mapping[str, int]) -> str:
    """Return the counters that are not zero with their descriptions, as part of a sentence."""
    return ", ".join(f"{counts[name]} {ODD_INPUT[name]}" for name in ODD_INPUT if counts.get(name))
