# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Strides given on the command line that are no whole number of frames of some recordings."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.scenes.taken_strides import rounded_strides, rounding_sentences

if TYPE_CHECKING:
    from mtpgo_training.training.training_config import TrainingConfig

STRIDES_OF_DATA = ("stride_s", "validation_stride_s")
"""Those of the section ``data`` of a configuration."""


def warn_of_scored_stride(stride_s: float | None, recordings: Sequence[NamedRecording]) -> None:
    """Say at which other stride recordings are scored.

    Args:
        stride_s: as given with ``--stride`` (s), None for the default.
        recordings: what is scored.
    """
    if stride_s is not None:
        _warn("--stride", stride_s, recordings, "instants are scored")


def warn_of_data_strides(
    settings: Iterable[str],
    configs: Iterable[TrainingConfig],
    recordings: Sequence[NamedRecording],
) -> None:
    """Say at which other stride recordings are cut into windows.

    Only of values that are given for this very run: a configuration file serves recordings of any
    rate, and its 0.4 s are one frame wherever there are two in a second.

    Args:
        settings: ``KEY=VALUE`` of the command line.
        configs: configurations with these values.
        recordings: what may be trained on.
    """
    keys = {setting.partition("=")[0] for setting in settings}
    configs = list(configs)
    for name in STRIDES_OF_DATA:
        if not keys & {"data", f"data.{name}"}:
            continue
        for stride_s in dict.fromkeys(getattr(config.data, name) for config in configs):
            _warn(f"data.{name}", stride_s, recordings, "windows can be cut")


def _warn(option: str, stride_s: float, recordings: Sequence[NamedRecording], what: str) -> None:
    taken_s = rounded_strides({item.name: item.recording for item in recordings}, stride_s)
    for sentence in rounding_sentences(option, stride_s, taken_s, what):
        print(f"mtpgo: warning: {sentence}", file=sys.stderr)
