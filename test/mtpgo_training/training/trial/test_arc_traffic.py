# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Made-up batches of the speed measurements: ragged as real ones, the same for every call."""

import torch

from models import ModelConfig
from mtpgo_training.training.trial.arc_traffic import arc_batch


def test_the_batch_is_a_ragged_one():
    batch = arc_batch(64, ModelConfig())
    sizes = batch.ptr.diff()
    assert 2 <= int(sizes.min()) < 5 < 13 < int(sizes.max()) <= 16
    assert 8.0 < float(sizes.float().mean()) < 10.0
    assert bool(batch.valid[:, -1].all())
    assert not bool(batch.valid.all())
    assert 0.0 < float((batch.weight == 0.0).float().mean()) < 0.3
    again = arc_batch(64, ModelConfig())
    assert all(torch.equal(batch[name], again[name]) for name in ("x", "target", "weight"))
