# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The hash over code: kept by moves and documentation, changed by numbers and formulas."""

import functools
import importlib
import sys
import time

import pytest

from mtpgo_training.data import code_hash
from mtpgo_training.data.code_hash import code_sha256, imported_modules
from mtpgo_training.data.ground_truth import future_columns
from mtpgo_training.data.readers.bags.bag_recordings import _read_bag
from mtpgo_training.data.readers.drone_recordings import DRONE_READERS, read_highd
from mtpgo_training.scenes.track_samples import take_in

TYPES = """
import dataclasses, enum, functools
import numpy as np

FOOT_M = 0.3048
TABLE = np.array([1.0, 2.0])


class Kind(enum.IntEnum):
    CAR = 1
    TRUCK = 2

    @classmethod
    def first(cls):
        return cls.CAR


@dataclasses.dataclass(frozen=True)
class Row:
    x: float
    scale: float = 2.0

    @property
    def doubled(self) -> float:
        return self.x * 2

    @functools.cached_property
    def tripled(self) -> float:
        return self.x * 3


def helper(value):
    def inner(other):
        return None if other is None else other * FOOT_M
    return [inner(v) for v in value]


def unused():
    return 1
"""

COMPUTE = """


def compute(row: Row, *, factor: float = 3.0) -> list[float]:
    if row is None:
        return None
    return helper([row.doubled * factor, TABLE[0], Kind.first()])
"""


@pytest.fixture(autouse=True)
def _made_up_package(monkeypatch, tmp_path):
    monkeypatch.setattr(code_hash, "PACKAGES", (*code_hash.PACKAGES, "made_up"))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield
    forget()


def forget():
    for name in [name for name in sys.modules if name.partition(".")[0] == "made_up"]:
        del sys.modules[name]
    for cached in (code_hash._tree, code_hash._imports, code_hash._digests):
        cached.cache_clear()


@pytest.fixture
def hash_of(tmp_path):
    """Write two modules of a package and hash the function ``compute`` in the second."""

    def write(name, source):
        path = tmp_path.joinpath(*name.split(".")).with_suffix(".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("from __future__ import annotations\n" + source)

    def hash_of(definitions=TYPES, compute=COMPUTE, *, where="made_up.rows", root="made_up.root"):
        forget()
        if where == root:
            write(root, definitions + compute)
        else:
            write(where, definitions)
            write(root, f"from {where} import TABLE, Kind, Row, helper\n{compute}")
        importlib.invalidate_caches()
        return code_sha256(importlib.import_module(root).compute)

    return hash_of


def test_the_same_code_has_the_same_hash(hash_of):
    assert hash_of() == hash_of()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("def helper(value):\n", 'def helper(value):\n    """Say what it does."""\n'),
        ("def compute(", "\n\n# A reason.\ndef compute("),
        ("    return helper(", "    # A reason.\n    return helper("),
        ("class Row:\n", 'class Row:\n    """A row."""\n'),
        ("    if row is None:", '    """Say what it does."""\n    if row is None:'),
        ("def helper(value)", "def helper(value: list[float]) -> list[float]"),
        ("x: float", "x: int"),
    ],
)
def test_what_does_not_change_a_result_keeps_the_hash(hash_of, old, new):
    assert old in TYPES + COMPUTE
    assert hash_of(TYPES.replace(old, new), COMPUTE.replace(old, new)) == hash_of()


def test_a_move_and_another_file_name_keep_the_hash(hash_of):
    assert hash_of(where="made_up.room.other", root="made_up.elsewhere") == hash_of()
    assert hash_of(where="made_up.all", root="made_up.all") == hash_of()


def test_imports_inside_a_function_are_followed(hash_of):
    inside = COMPUTE.replace(
        "    if row is None:", "    from made_up.rows import helper\n    if row is None:"
    )
    elsewhere = inside.replace("made_up.rows", "made_up.lines")
    assert hash_of(compute=inside) == hash_of(where="made_up.lines", compute=elsewhere)
    assert hash_of(TYPES.replace("0.3048", "0.3"), inside) != hash_of(compute=inside)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("0.3048", "0.3"),
        ("TRUCK = 2", "TRUCK = 3"),
        ("return cls.CAR", "return cls.TRUCK"),
        ("np.array([1.0, 2.0])", "np.array([1.0, 2.5])"),
        ("self.x * 2", "self.x * 4"),
        ("self.x * 3", "self.x + 3"),
        ("scale: float = 2.0", "scale: float = 1.0"),
        ("factor: float = 3.0", "factor: float = 4.0"),
        ("other * FOOT_M", "other / FOOT_M"),
        ("other * FOOT_M", "abs(other) * FOOT_M"),
        ("TABLE[0]", "TABLE[1]"),
        ("return None\n", "return []\n"),
        ("row.doubled * factor", "row.tripled * factor"),
    ],
)
def test_a_changed_number_or_formula_changes_the_hash(hash_of, old, new):
    assert old in TYPES + COMPUTE
    assert hash_of(TYPES.replace(old, new), COMPUTE.replace(old, new)) != hash_of()


def test_a_function_in_a_module_that_is_not_imported_keeps_the_hash(hash_of, tmp_path):
    before = hash_of()
    (tmp_path / "made_up" / "other.py").write_text("def other():\n    return 1\n")
    assert hash_of() == before


def test_lambdas_and_partial_functions_are_followed_and_data_is_not():
    one, other = (functools.partial(take_in, number) for number in (1, 2))
    assert code_sha256(one) == code_sha256(other) == code_sha256(take_in)
    assert code_sha256(take_in) != code_sha256(future_columns)
    assert code_sha256(lambda: take_in) == code_sha256()  # of a module outside of the project
    assert code_sha256(DRONE_READERS["highd"]) == code_sha256(read_highd)


def test_the_modules_of_cached_functions_are_followed_to_the_end():
    samples, drone, bag = (
        imported_modules([root.__module__]) for root in (take_in, read_highd, _read_bag)
    )
    assert {"mtpgo_core.history.track_update", "mtpgo_core.history.causal_slope"} <= samples
    assert {"mtpgo_training.data.recording", "mtpgo_core.task.task_description"} <= samples
    assert {"mtpgo_training.data.readers.csv_table", "mtpgo_core.schema"} <= drone
    assert {"msg_adapters.wire.cloud", "mtpgo_training.data.readers.bags.bag_poses"} <= bag
    assert "mtpgo_core.scene.scene_builder" not in samples | drone | bag


def test_the_hash_is_quick():
    forget()
    started = time.process_time()
    for root in (take_in, future_columns, read_highd):
        code_sha256(root)
    first_s = time.process_time() - started
    started = time.process_time()
    for _ in range(20):
        code_sha256(take_in)
    assert time.process_time() - started < 20 * first_s
    assert first_s < 1.0  # far above what was measured (0.03 s), for a busy machine
