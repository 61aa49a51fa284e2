# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which recordings a model has already seen, by its own account: no score on them is a test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

SEEN_USES = ("train", "validation")
"""Uses of a recording in training after which a score on it says little."""


def uses_of(training: Mapping[str, Any], sha256: str) -> list[str]:
    """What a recording was used for, each of ``train``, ``validation`` and ``test`` at most once.

    Args:
        training: the model's own account of its training, ``TaskDescription.training``.
        sha256: of the recording's source files.
    """
    entries = training.get("recordings", ())
    found = {
        str(entry.get("split"))
        for entry in entries
        if isinstance(entry, Mapping) and sha256 and entry.get("sha256") == sha256
    }
    return [use for use in (*SEEN_USES, "test") if use in found]


def seen_hashes(training: Mapping[str, Any]) -> set[str]:
    """SHA-256 of the recordings that took part in training or in choosing its best state."""
    entries = training.get("recordings", ())
    return {
        str(entry["sha256"])
        for entry in entries
        if isinstance(entry, Mapping) and entry.get("split") in SEEN_USES and "sha256" in entry
    }


def warnings_of(seen: Mapping[str, Mapping[str, Sequence[str]]]) -> list[str]:
    """One sentence for each model and use that spoils a result.

    Args:
        seen: by model and use, the names of the recordings, see :func:`seen_by`.
    """
    texts = {
        "train": "was trained on {}: its results include what it has learned by heart",
        "validation": "was chosen or calibrated on {}: its results there are a little too good",
    }
    return [
        f"{model} {texts[use].format(', '.join(seen[model][use]))}"
        for model in seen
        for use in SEEN_USES
        if seen[model].get(use)
    ]


def seen_by(
    trainings: Mapping[str, Mapping[str, Any]], recordings: Mapping[str, str]
) -> dict[str, dict[str, list[str]]]:
    """By model and use in its training, the names of those recordings.

    Args:
        trainings: by model, its own account.
        recordings: by name, the SHA-256.
    """
    return {
        model: {
            use: [
                name
                for name, sha256 in recordings.items()
                if (uses := uses_of(training, sha256)) and uses[0] == use
            ]
            for use in SEEN_USES
        }
        for model, training in trainings.items()
    }
