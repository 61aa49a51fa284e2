# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The section ``data`` of a training's configuration: splits, sampling, and presets for both."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import check_options, listed, option, require
from mtpgo_core.schema import AgentClass

SPLITS = ("recording", "time", "end")
SITE_KINDS = ("", "roundabout", "junction")
CLASSES = tuple(member.name.lower() for member in AgentClass)

_PAPER: dict[str, Any] = {
    "split": "time",
    "block_s": 60.0,
    "validation_fraction": 0.1,
    "test_fraction": 0.1,
    "restart_probability": 0.0,
    "min_future_s": 5.0,
}

PRESETS: dict[str, dict[str, Any]] = {
    "highd_paper": {
        **_PAPER,
        "stride_s": 1.0,
        "lane_change_share": 2.0 / 3.0,
        "lane_change_copies": 2.0,
        "centre_classes": ("car", "truck"),
    },
    "round_paper": {**_PAPER, "stride_s": 1.0, "centre_classes": ("car", "truck", "van")},
    "ind_paper": {
        **_PAPER,
        "stride_s": 1.0,
        "centre_classes": ("car", "truck", "bicycle", "pedestrian"),
    },
}
"""Values of :class:`DataConfig` by the name of a preset; sources in docs/recordings.md."""


@dataclass(frozen=True)
class DataConfig:
    """Which recordings train, validate and test, and how scenes are cut from them.

    A recording is named ``NAME`` or ``DIRECTORY/NAME`` with the last part of its directory.

    Attributes:
        preset: name of a preset in ``PRESETS`` for all values that a configuration file does not
            give; the saved configuration contains them all.
        split: ``recording``: a whole recording has one use; ``time``: recordings are divided into
            blocks of time, and each block has one use; ``end``: the end of each directory's
            recordings, in their order, is for validation and test. Never by track.
        block_s: length of such a block (s); at every border between two uses a whole window, its
            past and its future, is left out.
        validation: names of the recordings from which the checkpoint is chosen.
        test: names of the recordings that are not used in training.
        train: names of the recordings to train on; empty for all others.
        validation_fraction: share of the recordings (or blocks) drawn for validation where
            ``validation`` is empty.
        test_fraction: share drawn for the test where ``test`` is empty.
        stride_s: time between two windows of a training recording (s).
        validation_stride_s: time between two windows of a validation recording (s).
        restart_probability: share of the training scenes in which every agent was first seen
            within the last ``restart_within_s``, as after an occlusion or a tracker's restart.
        restart_within_s: longest time such agents have been seen (s).
        tracker_share: share of the training scenes whose observations come from a simulated
            tracker (:mod:`mtpgo_training.scenes.tracker.simulated_tracker`), with its noise, lag
            and gaps. The targets are still those of the recording. Of the trackers, the share
            ``restart_probability`` has short pasts.
        tracker_variants: simulated trackers drawn for each recording.
        unknown_class_share: share of the training scenes in which the class of every agent, or of
            a random half of the agents, is unknown.
        validation_tracker: validation scenes are cut twice, from the recordings and from the
            observations of one simulated tracker of each, so that a score is over both.
        mirror_probability: share of the training scenes that are mirrored (left for right): it
            doubles the data where the side of the road does not matter.
        rotation_std_rad: standard deviation of a random turn of the training scenes (rad), for
            sites where the scene's frame has no preferred direction.
        scale_std: standard deviation of the logarithm of a random scale of the training scenes:
            all lengths, speeds and accelerations by one factor.
        velocity_smoothing_s: standard deviation of the kernel that smooths the target velocities
            (s), 0 for the recorded ones; see
            :class:`mtpgo_training.data.ground_truth.FutureTable`.
        standing_weight: weight in the loss of an agent that is standing and does not move over its
            observed future. Below 1, moving agents weigh more, and the network takes it for less
            likely than it is that a standing agent stays where it is.
        standing_chance: chance of such an agent to be a graph's centre.
        min_future_s: an agent whose future is known for a shorter time is not a graph's centre in
            training (s): such graphs cost as much as others and contain fewer targets.
        centre_classes: names of the classes that may be a graph's centre in training; empty for
            all. The others are still neighbours, and their futures still count.
        lane_change_share: share of the training graphs whose centre changes its lane within the
            horizon, left and right alike; 0 leaves the graphs as the traffic gives them. See
            :func:`mtpgo_training.scenes.lane_change_balancing.balanced_copies`.
        lane_change_copies: graphs drawn around such a centre in each window on average, where
            ``lane_change_share`` is set; the graphs around those that keep their lane are thinned
            until the share is right.
        trails_none_probability: where the task has trails, share of the training scenes whose
            memory of trails is empty, as at the node's start.
        trails_partial_probability: share whose memory began at a random time since the
            recording's start; the others, like all of the validation, use the whole past.
        find_site_origins: where ``scene.frame`` is ``site_origin``: kind of the sites whose
            origins are found in the recordings if ``scene.site_origins`` does not name them, one
            of ``SITE_KINDS``; see :mod:`mtpgo_training.scenes.site_origins`.
        source_weight: how often scenes are drawn, by directory (its last part) or recording
            (``DIRECTORY/NAME``, which has priority); 1 by default.
    """

    preset: str = ""
    split: str = option("recording", choices=SPLITS)
    block_s: float = option(60.0, above=0.0, below=math.inf)
    validation: tuple[str, ...] = ()
    test: tuple[str, ...] = ()
    train: tuple[str, ...] = ()
    validation_fraction: float = option(0.1, low=0.0, high=1.0)
    test_fraction: float = option(0.0, low=0.0, high=1.0)
    stride_s: float = option(0.2, above=0.0, below=math.inf)
    validation_stride_s: float = option(1.0, above=0.0, below=math.inf)
    restart_probability: float = option(0.15, low=0.0, high=1.0)
    restart_within_s: float = option(1.2, above=0.0, below=math.inf)
    tracker_share: float = option(0.0, low=0.0, high=1.0)
    tracker_variants: int = option(3, low=1)
    unknown_class_share: float = option(0.0, low=0.0, high=1.0)
    validation_tracker: bool = False
    mirror_probability: float = option(0.0, low=0.0, high=1.0)
    rotation_std_rad: float = option(0.0, low=0.0, below=math.inf)
    scale_std: float = option(0.0, low=0.0, high=1.0)
    velocity_smoothing_s: float = option(0.0, low=0.0, below=math.inf)
    standing_weight: float = option(1.0, low=0.0, high=1.0)
    standing_chance: float = option(1.0, low=0.0, high=1.0)
    min_future_s: float = option(0.0, low=0.0, below=math.inf)
    centre_classes: tuple[str, ...] = option((), choices=CLASSES)
    lane_change_share: float = option(0.0, low=0.0, below=1.0)
    lane_change_copies: float = option(1.0, above=0.0)
    trails_none_probability: float = option(0.2, low=0.0, high=1.0)
    trails_partial_probability: float = option(0.4, low=0.0, high=1.0)
    find_site_origins: str = option("", choices=SITE_KINDS)
    source_weight: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_options(self, "data.")
        if self.preset:
            _check_preset(self.preset)
        for name, weight in self.source_weight.items():
            require("a name in data.source_weight", name, isinstance(name, str), "text")
            number = isinstance(weight, int | float) and not isinstance(weight, bool)
            allowed = number and 0.0 <= weight < math.inf
            require(f"data.source_weight.{name}", weight, allowed, "at least 0 and finite")
        shares = self.trails_none_probability + self.trails_partial_probability
        require(
            "data.trails_none_probability + data.trails_partial_probability",
            shares,
            shares <= 1.0 + 1e-9,
            "at most 1",
        )
        named = self.train or self.validation or self.test
        if self.split != "recording" and named:
            raise ConfigurationError(
                f"data.split is {self.split!r} but the recording {named[0]!r} is given a use by "
                "name, expected fractions only"
            )


def with_preset(data: Any) -> Any:
    """Return the section ``data`` of a configuration file with the values of its preset.

    Values that the file gives have priority over those of the preset.

    Raises:
        ConfigurationError: an unknown preset.
    """
    if not isinstance(data, dict) or not data.get("preset"):
        return data
    _check_preset(data["preset"])
    return {**PRESETS[data["preset"]], **data}


def _check_preset(name: Any) -> None:
    require("data.preset", name, name in PRESETS, f"one of {listed(PRESETS)}")
