# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Origins of sites that a configuration asks for and does not name."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.scenes.site_origins import find_origin
from mtpgo_training.training.training_config import TrainingConfig


def with_site_origins(
    config: TrainingConfig, recordings: Sequence[NamedRecording]
) -> TrainingConfig:
    """Return the configuration with an origin for each location of the recordings.

    Args:
        config: unchanged unless its ``data.find_site_origins`` is set.
        recordings: all recordings, whatever their use: an origin belongs to the site.

    Raises:
        ConfigurationError: no origin can be found for a site.
    """
    kind, scene = config.data.find_site_origins, config.scene
    if not kind or scene.frame != "site_origin":
        return config
    origins = dict(scene.site_origins)
    for location in sorted({item.recording.location for item in recordings} - origins.keys()):
        at_site = [item.recording for item in recordings if item.recording.location == location]
        origins[location] = find_origin(at_site, kind)
    return dataclasses.replace(config, scene=dataclasses.replace(scene, site_origins=origins))
