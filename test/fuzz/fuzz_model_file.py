# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Model files and checkpoints, as bytes and as valid archives of changed records."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path

from fuzz_readers import place
from fuzz_target import FuzzTarget

from mtpgo_core.task.model_file import find_model, is_model_file, model_of, read_model
from mtpgo_core.task.model_operators import foreign_operators

_KEPT = ("code/", "extra/", "data.pkl", "version", "constants/2")
"""Records of the shipped model that the seed has: the others only make it longer."""


def without_hash(task: bytes) -> bytes:
    """Return a task description without the hash of the content, which the seeds change."""
    return json.dumps({**json.loads(task), "content_sha256": ""}).encode()


def first_lines(code: bytes) -> bytes:
    """Return the begin of a model's code, in whole lines: half a name is refused."""
    return code[: code.rindex(b"\n", 0, 3000) + 1]


def small_model() -> bytes:
    """Return the shipped model with less code and without most weights."""
    buffer = io.BytesIO()
    with (
        zipfile.ZipFile(find_model("default")) as full,
        zipfile.ZipFile(buffer, "w") as out,
    ):
        for info in full.infolist():
            name = info.filename.partition("/")[2]
            if name.startswith(_KEPT) and not name.endswith(".debug_pkl"):
                text = full.read(info)
                if name.endswith("task.json"):
                    text = without_hash(text)
                out.writestr(info.filename, first_lines(text) if name.endswith(".py") else text)
    return buffer.getvalue()


def run_bytes(data: bytes) -> None:
    """Read a model file, as bytes and from the disk."""
    path = place("model") / "model.pt"
    path.write_bytes(data)
    is_model_file(path)
    read_model(path)


def run_records(data: bytes) -> None:
    """Read an archive that is valid, whose records are the input's lines."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("m/code/m.py", data.partition(_BETWEEN)[0])
        archive.writestr("m/extra/task.json", data.partition(_BETWEEN)[2])
    model_of(Path("m.pt"), buffer.getvalue())


_BETWEEN = b"\n====\n"


def record_seeds() -> list[bytes]:
    """Return code and task description of the shipped model."""
    with zipfile.ZipFile(find_model("default")) as full:
        names = full.namelist()
        code = full.read(next(name for name in names if name.endswith(".py")))
        task = full.read(next(name for name in names if name.endswith("task.json")))
    return [first_lines(code) + _BETWEEN + without_hash(task)]


def run_code(data: bytes) -> None:
    """Look for operators in any text; what calls from_file is never passed."""
    text = data.decode("latin-1")
    found = list(foreign_operators(text))
    if "torch.from_file" in text.replace(" ", "") and all(32 <= c < 127 for c in data):
        plain = text.partition("torch.from_file")[0]
        assert found or (plain and (plain[-1].isalnum() or plain[-1] in "_.")), text


def code_seeds() -> list[bytes]:
    """Return code that is allowed."""
    return [b"x = torch.add(a, b)\ny = ops.prim.min(1, 2)\nz : __torch__.m.Model = z\n"]


def checkpoint_target() -> FuzzTarget:
    """Return the target of checkpoints."""
    from mtpgo_training.training.run_folder import load_checkpoint

    def run(data: bytes) -> None:
        path = place("checkpoint") / "last.pt"
        path.write_bytes(data)
        load_checkpoint(path)

    def seeds() -> list[bytes]:
        import torch

        buffer = io.BytesIO()
        empty = {"config": {}, "model_config": {}, "metrics": {}, "splits": []}
        weights = {"average": {"w": torch.zeros(3)}, "epoch": 2, "step": 5}
        torch.save({"format": 1, **weights, **empty}, buffer)
        return [buffer.getvalue()]

    return FuzzTarget("checkpoint", run, seeds)


def targets() -> list[FuzzTarget]:
    """Return the targets of this file."""
    names: list[tuple[str, Callable[[bytes], None], Callable[[], list[bytes]]]] = [
        ("model_bytes", run_bytes, lambda: [small_model()]),
        ("model_records", run_records, record_seeds),
        ("model_code", run_code, code_seeds),
    ]
    return [*(FuzzTarget(*one) for one in names), checkpoint_target()]
