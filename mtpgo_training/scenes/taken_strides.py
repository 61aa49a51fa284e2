# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rounding of strides to whole frames of a recording."""

from __future__ import annotations

from collections.abc import Mapping

from mtpgo_training.data.recording import Recording
from mtpgo_training.scenes.windows import stride_frames

_ROUNDING = 0.01
"""Share of a stride by which that of the frames may differ without a word; chosen above that of
29.97 Hz and 30 Hz."""


def rounded_stride_s(recording: Recording, stride_s: float) -> float | None:
    """Return the stride that is used instead of the wanted one (s).

    None if it is the same, and where the recording is so short that only one instant is left.

    Args:
        recording: the recording.
        stride_s: as asked for (s).
    """
    if stride_s > recording.duration_s:
        return None
    taken_s = stride_frames(recording, stride_s) / recording.frame_rate
    return taken_s if abs(taken_s - stride_s) > _ROUNDING * stride_s else None


def rounded_strides(recordings: Mapping[str, Recording], stride_s: float) -> dict[str, float]:
    """Return :func:`rounded_stride_s` of the recordings that have one, by name."""
    found = {name: rounded_stride_s(one, stride_s) for name, one in recordings.items()}
    return {name: taken_s for name, taken_s in found.items() if taken_s is not None}


def rounding_sentences(
    option: str, stride_s: float, taken_s: Mapping[str, float], what: str
) -> list[str]:
    """Return a sentence for each rounded stride, with the recordings that it is used for.

    Args:
        option: that the stride was given with.
        stride_s: as given (s).
        taken_s: name of a recording -> the stride that it has (s).
        what: what is done at these instants.
    """
    names: dict[str, list[str]] = {}
    for name, one_s in taken_s.items():
        names.setdefault(f"{one_s:.3g}", []).append(name)
    return [
        f"{option} is {stride_s:g} s, which is no whole number of frames: {what} every {text} s "
        f"({first}{f' and {len(more)} more' if more else ''})"
        for text, (first, *more) in names.items()
    ]
