# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Origins of sites that a configuration asks for and does not name."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import listed
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
        ConfigurationError: no origin can be found for a site, or its location occurs in several
            directories. Models look origins up by the location alone, and directories that number
            their locations alike may show different places.
    """
    kind, scene = config.data.find_site_origins, config.scene
    if not kind or scene.frame != "site_origin":
        return config
    origins = dict(scene.site_origins)
    for location in sorted({item.recording.location for item in recordings} - origins.keys()):
        at_site = [item for item in recordings if item.recording.location == location]
        sources = list(dict.fromkeys(item.source for item in at_site))
        if len(sources) > 1:
            raise ConfigurationError(
                f"the location {location!r} occurs in {listed(sources)}, expected one directory "
                f"for each location; if it is the same place, give its origin in "
                f"scene.site_origins"
            )
        origins[location] = find_origin([item.recording for item in at_site], kind)
    return dataclasses.replace(config, scene=dataclasses.replace(scene, site_origins=origins))
