# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The batches of an epoch: their sizes, their order, and the shares of several processes."""

import contextlib
import dataclasses
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import torch
from tiny_run import CONFIG, new_run, with_options
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.data.splits import NamedRecording, Splits
from mtpgo_training.training.data_loading import epoch_loader, prepare_scenes
from mtpgo_training.training.run_loss import BatchLoss
from mtpgo_training.training.training_config import TrainingConfig


@pytest.fixture(scope="module")
def scenes():
    train, validation = (
        (NamedRecording("cars", braking_cars(name, tracks=4, seconds=4.0)),)
        for name in ("01", "02")
    )
    return prepare_scenes(CONFIG, Splits(train, validation, ()), 5, progress=False)


def batches(scenes, size=4, *, epoch=0, batch=0, rank=0, processes=1, config=CONFIG):
    """The scenes of the batches that are left of an epoch."""
    run = new_run(with_options(batch_scenes=size, config=config))
    run.state.epoch, run.state.batch = epoch, batch
    loader, count = epoch_loader(scenes.training, run, rank, processes)
    found = [list(scene) for scene in loader.batch_sampler]
    assert len(found) == count - batch
    return found


def expected_sizes(scenes, size):
    """Whole batches; a rest of less than half a batch joins the last one."""
    whole, rest = divmod(scenes, size)
    sizes = [size] * whole + ([rest] if rest else [])
    if whole and rest and 2 * rest < size:
        sizes[-2:] = [size + rest]
    return sizes


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 7, 8, 10, 1000])
def test_every_scene_is_in_one_batch_and_a_small_rest_joins_the_last(scenes, size):
    found = batches(scenes, size)
    n = len(scenes.training)
    assert sorted(scene for batch in found for scene in batch) == list(range(n))
    assert [len(batch) for batch in found] == expected_sizes(n, size)


def test_a_resumed_epoch_has_the_remaining_batches(scenes):
    whole = batches(scenes, epoch=3)
    assert batches(scenes, epoch=3, batch=4) == whole[4:]
    assert batches(scenes, epoch=3, batch=len(whole)) == []


def test_the_order_follows_from_seed_and_epoch(scenes):
    first = batches(scenes, epoch=1)
    assert batches(scenes, epoch=1) == first
    assert batches(scenes, epoch=2) != first
    other = dataclasses.replace(CONFIG, seed=CONFIG.seed + 1)
    assert batches(scenes, epoch=1, config=other) != first


@pytest.mark.parametrize("processes", [2, 3])
def test_processes_share_every_batch(scenes, processes):
    whole = batches(scenes, 8, epoch=1)
    shares = [batches(scenes, 8, epoch=1, rank=r, processes=processes) for r in range(processes)]
    for batch, *parts in zip(whole, *shares, strict=True):
        assert sorted(scene for part in parts for scene in part) == sorted(batch)
        assert all(parts)


def test_the_batches_contain_their_scenes(scenes):
    loader, _ = epoch_loader(scenes.training, new_run(with_options(batch_scenes=4)), 0, 1)
    first, batch = next(iter(loader.batch_sampler)), next(iter(loader))
    np.testing.assert_array_equal(
        batch.x.numpy(), np.concatenate([scenes.training[i].x.numpy() for i in first])
    )


@pytest.mark.parametrize(
    ("network", "epoch", "paired"),
    [
        ("mtp-go", 0, False),  # EWTA alone
        ("mtp-go", 2, True),
        ("mtp-go", 3, True),
        ("mtp-go", 7, False),  # the covariances alone
        ("mmtransformer", 3, False),
    ],
)
def test_scenes_are_pairs_where_the_loss_compares_them(network, epoch, paired):
    """To cut the window after each scene takes time."""
    data = dataclasses.replace(CONFIG.data, stride_s=0.4)
    model = {"hidden": 8, "modes": 2, "horizon_steps": 5}
    config = dataclasses.replace(CONFIG, data=data, network=network, model=model)
    run = new_run(with_options(config=config, consistency_weight=1.0, calibration_epochs=1))
    run.state.epoch = epoch
    cars = NamedRecording("cars", braking_cars("01", tracks=4, seconds=4.0))
    scenes = prepare_scenes(run.config, Splits((cars,), (cars,), ()), 5, progress=False)
    batch = next(iter(epoch_loader(scenes.training, run, 0, 1)[0]))
    assert ("later_x" in batch) == paired
    assert torch.isfinite(BatchLoss(run)(batch, False))


def test_a_recording_without_road_users_is_reported():
    recording = braking_cars()
    hidden = dataclasses.replace(recording, position=np.full_like(recording.position, np.nan))
    named = (NamedRecording("cars", hidden),)
    splits = Splits(train=named, validation=named, test=())
    with pytest.raises(ConfigurationError, match="no agent is present in any recording of data"):
        prepare_scenes(TrainingConfig(), splits, 10, progress=False)


def test_a_validation_without_a_future_is_refused():
    """It would have no scores after an epoch of training."""
    train = (NamedRecording("cars", braking_cars("01", tracks=4, seconds=4.0)),)
    short = (NamedRecording("cars", braking_cars("02", tracks=4, seconds=4.0).between(3.9, None)),)
    with pytest.raises(ConfigurationError, match="is observed at any step after it was predicted"):
        prepare_scenes(CONFIG, Splits(train, short, ()), 5, progress=False)


LOADING = """
import sys, time
from tiny_run import new_run, with_options
from traffic import braking_cars
from mtpgo_training.data.splits import NamedRecording, Splits
from mtpgo_training.training.data_loading import epoch_loader, prepare_scenes
cars = NamedRecording("cars", braking_cars("01", tracks=4, seconds=4.0))
config = with_options(batch_scenes=1, trainer={"loader_workers": 1})
scenes = prepare_scenes(config, Splits((cars,), (cars,), ()), 5, progress=False)
batches = iter(epoch_loader(scenes.training, new_run(config), 0, 1)[0])
next(batches)
print(batches._workers[0].pid, flush=True)
time.sleep(600)
"""
"""Has a worker cut scenes and says its process ID."""


def test_the_workers_of_a_killed_training_end():
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, "-W", "ignore", "-c", LOADING],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
    ) as main:
        worker = int(main.stdout.readline())
        main.kill()
    end_s = time.monotonic() + 30.0
    try:
        while _runs(worker):
            assert time.monotonic() < end_s, "the worker stays"
            time.sleep(0.05)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(worker, signal.SIGKILL)


def _runs(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True
