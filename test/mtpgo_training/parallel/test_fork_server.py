# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The server of processes, in a program of its own: what its forks have, and what it leaves."""

import subprocess
import sys

import pytest

PROGRAM = """
import multiprocessing, os, signal, sys
from mtpgo_training.parallel.fork_server import start_fork_server
from mtpgo_training.parallel.pool_options import PoolOptions

def look(out):
    loaded = "mtpgo_training.parallel.work_pool" in sys.modules, "distributed" in sys.modules
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [])
    out.send((loaded, os.environ.get("MALLOC_ARENA_MAX"), signal.SIGINT in mask))

if __name__ == "__main__":
    os.environ["OMP_NUM_THREADS"] = "7"
    before = dict(os.environ)
    start_fork_server(PoolOptions(jobs=2), "mtpgo_training.parallel.work_pool")
    start_fork_server(PoolOptions(jobs=2), "no_such_module")
    assert dict(os.environ) == before
    assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == set()
    here, there = multiprocessing.Pipe()
    context = multiprocessing.get_context("forkserver")
    process = context.Process(target=look, args=(there,))
    process.start()
    print("distributed" in sys.modules, *here.recv())
    process.join()
"""


def test_forks_have_what_was_imported_and_this_process_is_as_before(tmp_path):
    pytest.importorskip("distributed")
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    run = subprocess.run([sys.executable, program], capture_output=True, text=True, check=False)
    assert run.stderr == ""
    assert run.stdout == "False (True, True) 1 True\n"


@pytest.mark.parametrize("options", ["jobs=1", "cluster='tcp://a:1'"])
def test_nothing_is_started_where_no_processes_of_this_machine_are_wanted(options):
    program = (
        "from multiprocessing import forkserver\n"
        "from mtpgo_training.parallel.fork_server import start_fork_server\n"
        "from mtpgo_training.parallel.pool_options import PoolOptions\n"
        f"start_fork_server(PoolOptions({options}), 'math')\n"
        "print(forkserver._forkserver._forkserver_pid)"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (run.stdout, run.stderr) == ("None\n", "")
