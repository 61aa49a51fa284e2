# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Devices and machines that are not there are one sentence before anything waits for them."""

import pytest
from tiny_run import with_options

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.training.loop.device_setup import fabric_for
from mtpgo_training.training.run_folder import RunFolder
from mtpgo_training.training.trainer import require_startable

TWO_MACHINES = with_options(trainer={"num_nodes": 2, "accelerator": "cpu"})


@pytest.fixture(autouse=True)
def no_cluster(monkeypatch):
    for name in ("MASTER_ADDR", "NODE_RANK", "GROUP_RANK"):
        monkeypatch.delenv(name, raising=False)


def test_machines_that_nothing_says_where_they_are_are_refused(tmp_path, monkeypatch):
    folder = RunFolder(tmp_path / "r")
    sentence = "trainer.num_nodes is 2, and neither torchrun, SLURM or MPI has started"
    with pytest.raises(ConfigurationError, match=sentence):
        require_startable(TWO_MACHINES, folder, resume=False, init_from=None)
    monkeypatch.setenv("MASTER_ADDR", "10.0.0.1")
    with pytest.raises(ConfigurationError, match=sentence):  # which of the two this one is
        fabric_for(TWO_MACHINES)


def test_machines_are_found_by_the_environment_variables(monkeypatch):
    monkeypatch.setenv("MASTER_ADDR", "10.0.0.1")
    monkeypatch.setenv("NODE_RANK", "1")
    fabric = fabric_for(TWO_MACHINES)
    assert (fabric.world_size, fabric.global_rank) == (2, 1)
