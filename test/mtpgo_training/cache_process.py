# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a process of the cache's tests runs; spawn imports it by name."""

import numpy as np

from mtpgo_training.data.recording_cache import RecordingCache


def make_and_count(folder, made):
    """Read an entry of the cache, and count in ``made`` if it has to be made."""

    def make():
        with made.get_lock():
            made.value += 1
        return {"a": np.arange(100_000), "none": np.zeros((0, 2))}

    columns = RecordingCache(folder).entry({"what": "test"}, make, code=())
    assert columns["a"][-1] == 99_999
    assert columns["none"].shape == (0, 2)
