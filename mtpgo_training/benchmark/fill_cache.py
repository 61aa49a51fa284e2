# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Script measured by the conversion benchmark: prepare recordings for training, with a cache.

Run as ``python -m mtpgo_training.benchmark.fill_cache DIRECTORY LAYOUT CACHE``.
"""

from __future__ import annotations

import sys
from pathlib import Path

from mtpgo_core.errors import MtpgoError
from mtpgo_training.data.readers import iter_recordings
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.scenes.prepared_recording import prepare
from mtpgo_training.training.training_config import TrainingConfig


def main(directory: str, layout: str, folder: str) -> int:
    """Fill the cache, or read its entries, and return the exit status."""
    config, cache = TrainingConfig(), RecordingCache(Path(folder))
    try:
        for recording in iter_recordings(Path(directory), layout, cache=cache):
            prepare(
                recording, config.history, config.scene, config.data, training=True, cache=cache
            )
    except MtpgoError as error:
        print(f"fill_cache: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:4]))
