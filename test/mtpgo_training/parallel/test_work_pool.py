# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Items through one function: order, failures, processes that end, faults of every item."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from numbered_work import Noted, Number, first_last, refuse, work

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.parallel.pool_options import HERE, PoolOptions
from mtpgo_training.parallel.work_item import Failure
from mtpgo_training.parallel.work_pool import work_through

ROOT = Path(__file__).parents[3]


def test_results_come_in_order_and_failures_in_their_places():
    items = [Number(i) for i in (1, 3, 5, 4)]
    one, two, three, four = work_through(work, items, HERE)
    assert (one, four) == (1, 16)
    assert two == Failure("n3", "n3.csv ends within line 7")
    assert three == Failure("n5", "unexpected ZeroDivisionError: no such thing")
    assert str(two) == "n3: n3.csv ends within line 7"


def test_what_is_wrong_for_every_item_is_raised():
    with pytest.raises(ConfigurationError, match="class map"):
        list(work_through(refuse, [Number(1), Number(2)], HERE))


def test_one_process_needs_no_dask():
    code = (
        "import sys; sys.modules['distributed'] = None; sys.modules['dask'] = None\n"
        "from mtpgo_training.parallel.work_pool import work_through\n"
        "from mtpgo_training.parallel.pool_options import HERE\n"
        "print(list(work_through(len, ['a', 'bc'], HERE)))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "[1, 2]\n"


def test_processes_give_the_same_and_one_that_ends_costs_its_item_only(monkeypatch, caplog):
    pytest.importorskip("distributed")
    monkeypatch.setenv("DASK_PARENT", str(os.getpid()))
    items = [Number(i) for i in range(12)]
    found = list(work_through(work, items, PoolOptions(jobs=2)))
    expected = [i**2 for i in range(12)]
    assert [r for r in found if not isinstance(r, Failure)] == [
        v for i, v in enumerate(expected) if i not in (3, 5, 6)
    ]
    assert {i: found[i].reason for i in (3, 5, 6)} == {
        3: "n3.csv ends within line 7",
        5: "unexpected ZeroDivisionError: no such thing",
        6: "its process ended without an answer, as when the memory is full",
    }
    assert [r.getMessage() for r in caplog.records if r.name == "mtpgo"] == ["seven is odd"]


def test_results_come_in_the_order_of_the_items_whichever_is_done_first(tmp_path):
    pytest.importorskip("distributed")
    items = [Noted(i, tmp_path) for i in range(4)]
    found = list(work_through(first_last, items, PoolOptions(jobs=2)))
    assert [value for value, _ in found] == [0, 1, 2, 3]
    assert found[0][1] >= 2


CLOSING = """
import os, signal
from multiprocessing import forkserver
from numbered_work import Number, work
from mtpgo_training.parallel.pool_options import PoolOptions
from mtpgo_training.parallel.work_pool import work_through

if __name__ == "__main__":
    found = []
    try:
        for result in work_through(work, [Number(1), Number(2)], PoolOptions(jobs=2)):
            found.append(result)
            if len(found) == 2:
                os.kill(forkserver._forkserver._forkserver_pid, signal.SIGSTOP)
    finally:
        os.kill(forkserver._forkserver._forkserver_pid, signal.SIGCONT)
    print(found, flush=True)
    os._exit(0)  # without Dask's own tries at the exit, which take ten more seconds
"""
"""Gets results, and then the server that says when processes have ended gets no processor."""


def test_processes_whose_end_is_not_told_do_not_take_along_the_results(tmp_path):
    pytest.importorskip("distributed")
    program = tmp_path / "closing.py"
    program.write_text(CLOSING)
    path = os.pathsep.join(str(ROOT / part) for part in ("", "test/mtpgo_training"))
    environment = {**os.environ, "PYTHONPATH": path}
    run = subprocess.run(
        [sys.executable, program], capture_output=True, text=True, check=False, env=environment
    )
    assert (run.stdout, run.returncode) == ("[1, 4]\n", 0), run.stderr


def test_small_items_are_handed_out_together_and_one_that_ends_a_process_costs_itself(monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setenv("DASK_PARENT", str(os.getpid()))
    handed_out = []
    submit = distributed.Client.submit

    def counted(self, *args, **kwargs):
        handed_out.append(args)
        return submit(self, *args, **kwargs)

    monkeypatch.setattr(distributed.Client, "submit", counted)
    items = [Number(6 if i == 60 else 10 + i) for i in range(80)]
    found = list(work_through(work, items, PoolOptions(jobs=2)))
    reason = "its process ended without an answer, as when the memory is full"
    assert found.pop(60) == Failure("n6", reason)
    assert found == [(10 + i) ** 2 for i in range(80) if i != 60]
    assert len(handed_out) < 70


def test_a_cluster_by_its_address_and_faults_of_every_item():
    distributed = pytest.importorskip("distributed")
    local = {"processes": False, "dashboard_address": None, "threads_per_worker": 1}
    with distributed.LocalCluster(n_workers=1, protocol="tcp", **local) as cluster:
        options = PoolOptions(cluster=cluster.scheduler_address)
        items = [Number(1), Number(3), Number(4)]
        assert list(work_through(work, items, options)) == list(work_through(work, items, HERE))
        with pytest.raises(ConfigurationError, match="class map"):
            list(work_through(refuse, items, options))


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nowhere", "quic://a:1"])
def test_a_cluster_that_does_not_answer_is_one_sentence(address, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("mtpgo_training.parallel.work_pool.TIMEOUT_S", 0.5)
    with pytest.raises(ConfigurationError, match="where no Dask scheduler answers"):
        list(work_through(work, [Number(1)], PoolOptions(cluster=address)))


@pytest.mark.parametrize(
    ("values", "sentence"),
    [({"jobs": 0}, "jobs is 0"), ({"jobs": 2, "cluster": "tcp://a:1"}, "a cluster is given")],
)
def test_options_that_are_not_allowed(values, sentence):
    with pytest.raises(ConfigurationError, match=sentence):
        PoolOptions(**values)
