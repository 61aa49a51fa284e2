# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Overlap of the evaluated recordings with a model's training data, as the model file lists it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mtpgo_training.data.readers.recording_parts import share_time

CALIBRATION = "calibration"
"""Use of a recording that covariances and weights were calibrated on."""

OVERLAPPING_USES = ("train", "validation", CALIBRATION)
"""Uses of a recording in training that make a score on it no test result."""


def uses_of(training: Mapping[str, Any], sha256: str, name: str = "") -> list[str]:
    """Return the uses of a recording in training, each once: those that overlap, and ``test``.

    Args:
        training: the model's description of its training, ``TaskDescription.training``.
        sha256: of the recording's source files.
        name: of the recording. One that is a part by time (``01@480-846s``) does not overlap with
            parts of the same files at other times.
    """
    entries = training.get("recordings", ())
    found = {
        str(entry.get("split"))
        for entry in entries
        if isinstance(entry, Mapping)
        and sha256
        and entry.get("sha256") == sha256
        and share_time(name, str(entry.get("name", "")))
    }
    return [use for use in (*OVERLAPPING_USES, "test") if use in found]


def is_known(training: Mapping[str, Any], sha256: str, name: str = "") -> bool:
    """Return whether a recording was used in training, in choosing its state or in calibrating.

    Args:
        training: as in :func:`uses_of`, as ``sha256`` and ``name``.
        sha256: of the recording's source files.
        name: of the recording.
    """
    return not set(OVERLAPPING_USES).isdisjoint(uses_of(training, sha256, name))


def overlap_warnings(overlaps: Mapping[str, Mapping[str, Sequence[str]]]) -> list[str]:
    """Return one sentence for each model and use that makes a result too good.

    Args:
        overlaps: by model and use, the names of the recordings, see :func:`overlap_by_model`.
    """
    texts = {
        "train": "was trained on {}: its results include what it has memorised",
        "validation": "was chosen or calibrated on {}: its results there are a little too good",
        CALIBRATION: "was calibrated on {}: its covariances fit there a little too well",
    }
    return [
        f"{model} {texts[use].format(', '.join(overlaps[model][use]))}"
        for model in overlaps
        for use in OVERLAPPING_USES
        if overlaps[model].get(use)
    ]


def overlap_by_model(
    trainings: Mapping[str, Mapping[str, Any]], recordings: Mapping[str, str]
) -> dict[str, dict[str, list[str]]]:
    """Return the names of the recordings that each model has seen, by model and use.

    Args:
        trainings: by model, its description of its training.
        recordings: by name, the SHA-256.
    """
    return {
        model: {
            use: [
                name
                for name, sha256 in recordings.items()
                if (uses := uses_of(training, sha256, name)) and uses[0] == use
            ]
            for use in OVERLAPPING_USES
        }
        for model, training in trainings.items()
    }
