# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Jobs that are killed with SIGKILL at random moments leave nothing half-written.

``make interruption KILLS=20`` kills each job 20 times, the test suite once. The moments are drawn
between the start of the job and a little after the time that it takes by itself.
"""

import multiprocessing
import os
import random
import shutil
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch
import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "mtpgo_training"))
sys.path.insert(0, str(Path(__file__).parent))
import killed_jobs
from traffic import braking_cars

from msg_adapters.bags.stored_bag import StoredBag
from mtpgo_core.errors import RecordingError
from mtpgo_training import cli
from mtpgo_training.data.data_sources import DataSource, read_sources
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.writers.ind_writer import write_ind

KILLS = int(os.environ.get("MTPGO_KILLS", "1"))
LIMIT_S = 120.0
SHORT = KILLS < 5
SHORT_S = 0.5
"""Duration of a job that is not measured (s); chosen: about that of the work."""

CONFIG = {
    "name": "tiny",
    "num_threads": 1,
    "data": {"validation": ["03"], "stride_s": 0.4, "restart_probability": 0.0},
    "model": {"hidden": 8, "modes": 2, "horizon_steps": 5, "layer": "graphconv"},
    "optimisation": {"epochs": 3, "batch_scenes": 8},
}

pytestmark = pytest.mark.timeout(60 + 60 * KILLS)


@pytest.fixture(scope="module")
def jobs():
    """A context whose processes are forked from one that has imported everything."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(killed_jobs.PRELOADED))
    return context


@pytest.fixture
def moments():
    """Draws the same moments in every run; what they hit depends on the machine."""
    return random.Random(1)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Three recordings and a training's configuration."""
    folder = tmp_path_factory.mktemp("place")
    for seed in (1, 2, 3):
        cars = braking_cars(f"{seed:02d}", seed=seed, tracks=4, seconds=4.5)
        write_ind(cars, folder / "cars")
    (folder / "c.yaml").write_text(yaml.safe_dump(CONFIG), encoding="utf-8")
    return folder


def duration_of(jobs, target, *arguments):
    """Return how long a job takes by itself (s)."""
    if SHORT:
        return SHORT_S
    run(jobs, target, *arguments)  # the first one also starts the fork server
    duration_s, status = run(jobs, target, *arguments)
    assert status == 0
    return duration_s


def run(jobs, target, *arguments, after_s=None):
    """Run a job to its end, or kill it after a time; return its duration (s) and status."""
    process = jobs.Process(target=target, args=arguments)
    start = time.monotonic()
    process.start()
    process.join(LIMIT_S if after_s is None else after_s)
    if process.is_alive():
        assert after_s is not None, "the job did not end in time"
        os.kill(process.pid, signal.SIGKILL)
        process.join(LIMIT_S)
    return time.monotonic() - start, process.exitcode


def killed(jobs, moments, duration_s, target, *arguments):
    """Kill a job at a random moment; return whether it had ended before."""
    _, status = run(jobs, target, *arguments, after_s=moments.uniform(0.0, 1.2 * duration_s))
    assert status in (0, -signal.SIGKILL)
    return status == 0


def visible(folder):
    return sorted(p.name for p in folder.iterdir() if not p.name.startswith("."))


@pytest.mark.parametrize("name", ["bag"] if SHORT else ["bag", "bag.mcap"])
def test_a_conversion_leaves_whole_bags_only(jobs, moments, place, tmp_path, name):
    path = tmp_path / name
    arguments = ["convert", "ind", str(place / "cars"), "--join", "-o", str(path)]
    duration_s = duration_of(jobs, killed_jobs.mtpgo, arguments)
    assert cli.main(arguments) == 0
    with StoredBag(path) as bag:
        expected = list(bag.messages())
    ended = 0
    for _ in range(KILLS):
        if moments.random() < 0.5 and path.exists():
            # Without an earlier bag to be replaced.
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        ended += killed(jobs, moments, duration_s, killed_jobs.mtpgo, arguments)
        assert visible(tmp_path) in ([], [name])
        if path.exists():
            if path.is_dir():
                assert visible(path) == ["bag.mcap", "metadata.yaml"]
            with StoredBag(path) as bag:
                assert [m[1:] for m in bag.messages()] == [m[1:] for m in expected]
                assert bag.losses() == []
    assert ended < KILLS or SHORT, "no job was killed"


def test_a_cache_gives_what_the_files_hold(jobs, moments, place, tmp_path, caplog):
    expected = load_recordings(place / "cars", "ind")
    build, data, cache = killed_jobs.build_cache, place / "cars", tmp_path / "cache"
    duration_s = duration_of(jobs, build, data, cache)
    for _ in range(KILLS):
        shutil.rmtree(cache, ignore_errors=True)
        killed(jobs, moments, duration_s, build, data, cache)
        found = read_sources([DataSource(data, "ind")], RecordingCache(cache))
        for one, other in zip(expected, found, strict=True):
            np.testing.assert_array_equal(other.recording.position, one.position)
            np.testing.assert_array_equal(other.recording.track, one.track)
        assert "damaged" not in caplog.text


def weights(path):
    return torch.load(path, weights_only=True)["average"]


def same_weights(one, other):
    return one.keys() == other.keys() and all(torch.equal(one[k], other[k]) for k in one)


@pytest.fixture(scope="module")
def whole(jobs, place):
    """A training that was not interrupted, and its duration (s)."""
    arguments = training(place, place / "whole")
    if SHORT:
        assert cli.main(arguments) == 0
        return place / "whole", SHORT_S
    duration_s, status = run(jobs, killed_jobs.mtpgo, arguments)
    assert status == 0
    return place / "whole", duration_s


def training(place, out):
    arguments = [place / "c.yaml", "--data", place / "cars", "--layout", "ind", "--out", out]
    resume = ["--resume"] if out.exists() else []
    return ["train", *map(str, arguments), "--no-cache", "--quiet", *resume]


def test_a_training_that_is_killed_again_and_again_ends_with_the_same_weights(
    jobs, moments, place, whole, tmp_path
):
    expected, duration_s = whole
    out = tmp_path / "run"
    for number in range(KILLS):
        if out.exists() and (out / "last.pt").exists():
            weights(out / "last.pt")
        if killed(jobs, moments, duration_s, killed_jobs.mtpgo, training(place, out)):
            # It has ended: another one begins.
            assert same_weights(weights(out / "last.pt"), weights(expected / "last.pt"))
            out = tmp_path / f"run{number}"
        for path in out.glob("*.pt"):
            weights(path)
        if (out / "log.csv").exists():
            log = (out / "log.csv").read_text()
            assert (expected / "log.csv").read_text().startswith(log.splitlines()[0])
    assert cli.main(training(place, out)) == 0
    for name in ("last.pt", "best.pt"):
        assert same_weights(weights(out / name), weights(expected / name)), name


def test_an_export_leaves_whole_model_files_only(jobs, moments, whole, tmp_path):
    run_folder, _ = whole
    path = tmp_path / "m.pt"
    arguments = ["export", str(run_folder), "-o", str(path)]
    duration_s = duration_of(jobs, killed_jobs.mtpgo, arguments)
    for _ in range(KILLS):
        path.unlink(missing_ok=True)
        killed(jobs, moments, duration_s, killed_jobs.mtpgo, arguments)
        assert visible(tmp_path) in ([], ["m.pt"])
        if path.exists():
            assert cli.main(["info", str(path)]) == 0


@pytest.mark.skipif(SHORT, reason="test_record.py kills one recording")
def test_a_recording_keeps_what_was_written_a_second_before(jobs, moments, tmp_path):
    domain = os.environ["ROS_DOMAIN_ID"]
    publisher = jobs.Process(target=killed_jobs.publish, args=("/numbers", domain), daemon=True)
    publisher.start()
    filled = 0
    try:
        for number in range(KILLS):
            path = tmp_path / (f"bag{number}" + (".mcap" if number % 2 else ""))
            arguments = ["-o", str(path), "--topics", "/numbers"]
            killed(jobs, moments, 4.0, killed_jobs.record, arguments, domain)
            assert visible(tmp_path) in ([], [path.name])
            numbers = numbers_in(path)
            filled += len(numbers) > 0
            if numbers:
                assert numbers == list(range(numbers[0], numbers[-1] + 1))
            if path.is_dir():
                shutil.rmtree(path)
            path.unlink(missing_ok=True)
    finally:
        publisher.kill()
        publisher.join()
    assert filled, "no recording was killed after its first second"


def numbers_in(path):
    """Return the numbers in a bag, none if it was killed before its first record."""
    try:
        with StoredBag(path) as bag:
            return [int(data[8:16]) for _, _, data in bag.messages()]
    except (RecordingError, FileNotFoundError):
        files = list(path.rglob("*")) if path.is_dir() else [path]
        # Not more than the definition of the type.
        assert sum(file.stat().st_size for file in files if file.is_file()) < 2000
        return []
