# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Jobs in processes: done, with an error, with a defect, and ended by an interrupt."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from light_job import LightJob

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import only_writer
from mtpgo_training.crossval.fold_processes import run_folds


class Request:
    """A request to end that comes once a file is there."""

    received_signal = signal.SIGINT

    def __init__(self, path=None):
        self.path = path

    def requested(self):
        return self.path is not None and self.path.exists()


class Told:
    """What was reported, in order."""

    def __init__(self):
        self.lines = []

    def run(self, jobs, processes=1, request=None):
        run_folds(
            jobs,
            processes,
            request or Request(),
            started=lambda job: self.lines.append(f"{job.folder.name} started"),
            finished=lambda job: self.lines.append(f"{job.folder.name} finished"),
            failed=lambda job, error: self.lines.append(f"{job.folder.name} failed: {error}"),
        )
        return self.lines


def test_one_after_the_other(tmp_path):
    told = Told().run([LightJob(tmp_path / "a"), LightJob(tmp_path / "b")])
    assert told == ["a started", "a finished", "b started", "b finished"]
    assert (tmp_path / "a" / "fold.log").read_text() == "this is done\n"


def test_two_at_the_same_time(tmp_path):
    told = Told().run([LightJob(tmp_path / name) for name in "abc"], 2)
    assert told[:2] == ["a started", "b started"]
    assert sorted(told[2:]) == ["a finished", "b finished", "c finished", "c started"]


@pytest.mark.parametrize(
    ("how", "sentence"),
    [
        ("error", "data.train is empty"),
        ("defect", "the process ended with status 1, see {log}"),
        ("killed", "the process ended with status -6, see {log}"),
    ],
)
def test_a_failure_is_told_and_the_others_go_on(tmp_path, how, sentence):
    told = Told().run([LightJob(tmp_path / "a", how), LightJob(tmp_path / "b")])
    log = tmp_path / "a" / "fold.log"
    assert told[1:] == [f"a failed: {sentence.format(log=log)}", "b started", "b finished"]
    assert ("ZeroDivisionError: a defect" in log.read_text()) == (how == "defect")


def test_a_folder_of_another_process_is_left_alone(tmp_path):
    (tmp_path / "a").mkdir()
    with only_writer(tmp_path / "a"):
        told = Told().run([LightJob(tmp_path / "a"), LightJob(tmp_path / "b")])
    assert told[1] == (
        f"a failed: {tmp_path / 'a'} is being written by another process, expected one at a time"
    )
    assert told[-1] == "b finished"
    assert (tmp_path / "a" / "fold.log").read_text() == ""


def test_a_request_ends_what_runs_and_what_waits(tmp_path):
    jobs = [LightJob(tmp_path / name, "long") for name in "abc"]
    told = Told().run(jobs, 2, Request(tmp_path / "b" / "running"))
    assert told == ["a started", "b started"]


def test_an_exception_ends_the_processes(tmp_path):
    class Broken(Request):
        def requested(self):
            if (tmp_path / "a" / "running").exists():
                raise KeyboardInterrupt
            return False

    with pytest.raises(KeyboardInterrupt):
        Told().run([LightJob(tmp_path / "a", "long")], 1, Broken())


PARENT = """
import sys
from pathlib import Path
from light_job import LightJob
from test_fold_processes import Request
from mtpgo_training.crossval.fold_processes import run_folds
if __name__ == "__main__":
    run_folds([LightJob(Path(sys.argv[1]), "long")], 1, Request())
"""


def test_the_fold_of_a_killed_process_ends(tmp_path):
    """It would train on for hours, and hold the folder of its run."""
    (tmp_path / "parent.py").write_text(PARENT)
    folder = tmp_path / "a"
    paths = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    with subprocess.Popen(
        [sys.executable, str(tmp_path / "parent.py"), str(folder)],
        env={**os.environ, "PYTHONPATH": paths},
    ) as parent:
        wait_for((folder / "running").exists, 300.0)
        with pytest.raises(ConfigurationError), only_writer(folder):
            pass
        parent.kill()
    wait_for(lambda: is_free(folder), 50.0)  # the job would end by itself 60 s after its start
    assert "Traceback" not in (folder / "fold.log").read_text()


def is_free(folder):
    try:
        with only_writer(folder):
            return True
    except ConfigurationError:
        return False


def wait_for(condition, longest_s):
    until_s = time.monotonic() + longest_s
    while not condition() and time.monotonic() < until_s:
        time.sleep(0.02)
    assert condition()
