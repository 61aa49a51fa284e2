# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Model files that attack who loads them, each with the words of the error that it must get."""

import io
import json
import os
import pickle
import struct
import warnings
import zipfile

import torch
from core_helpers import HORIZON, MODES, StraightModel

from mtpgo_core.task.task_description import TASK_FILE, TaskDescription

TASK = TaskDescription(name="hostile", horizon_steps=HORIZON, modes=MODES)


def straight():
    """Return the bytes of a model that computes what it should."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return saved(torch.jit.script(StraightModel(2, HORIZON, MODES, 0.2)), TASK)


def hostile(lines):
    """Return the bytes of the straight model with more lines of code at the start of forward."""

    def attacked(code):
        head, arrow, body = code.decode().partition("Tuple[Tensor, Tensor, Tensor]:\n")
        assert arrow
        return (head + arrow + "".join(f"    {line}\n" for line in lines) + body).encode()

    return edited(straight(), ".py", attacked)


def saved(module, task):
    """Return the bytes of a scripted module as a model file."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.jit.save(module, buffer, _extra_files={TASK_FILE: task.to_json()})
    return buffer.getvalue()


def records_of(data):
    """Return the records of a model file by full name."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {info.filename: archive.read(info) for info in archive.infolist()}


def packed(records, method=zipfile.ZIP_STORED):
    """Return the bytes of an archive of these records."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name, content in records.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def edited(data, ending, change):
    """Return a model file whose record with this ending is changed."""
    records = records_of(data)
    name = next(name for name in records if name.endswith(ending))
    return packed({**records, name: change(records[name])})


def with_task(data, **values):
    """Return a model file with some values of its task description changed."""
    return edited(
        data,
        TASK_FILE,
        lambda text: json.dumps({**json.loads(text), **values}).encode(),
    )


def writes_a_file(place):
    """A TorchScript that creates a file of 4 kB."""
    return hostile([f'torch.from_file("{place}", True, 1024)'])


def saves_a_file(place):
    """A TorchScript that calls torch.save."""
    return hostile([f'torch.save(features, "{place}")'])


def prints():
    """A TorchScript that writes to stdout."""
    return hostile(['print("hostile")'])


def loops_for_ever():
    """An endless loop in forward."""
    return hostile(["while True:", "  features = torch.add(features, 1)"])


def loops_by_its_data():
    """A loop that ends only if the data say so."""
    return hostile(
        [
            "while bool(torch.all(torch.isfinite(features))):",
            "  features = torch.mul(features, 1)",
        ]
    )


def counts_for_ever():
    """A loop of more repetitions than a lifetime has microseconds."""
    return hostile(["for i in range(1000000000000):", "  features = torch.mul(features, 1)"])


def repeats_what_the_data_say():
    """A loop whose number of repetitions is computed from the data."""
    return hostile(
        ["for i in range(int(torch.sum(features))):", "  features = torch.mul(features, 1)"]
    )


def loops_in_loops():
    """Loops each of which looks harmless, together 10^15 repetitions."""
    return hostile(
        [
            "for i in range(100000):",
            "  for j in range(100000):",
            "    for k in range(100000):",
            "      features = torch.mul(features, 1)",
        ]
    )


def asks_for_memory():
    """Tensors of a terabyte and more."""
    return hostile(
        [
            "big = torch.ones([300000, 1000000])",
            "features = torch.add(features, torch.sum(big))",
        ]
    )


def grows():
    """A tensor that doubles forty times."""
    return hostile(
        ["x = torch.ones([1000])", "for i in range(40):", "  x = torch.cat([x, x])",
         "features = torch.add(features, torch.sum(x))"]
    )  # fmt: skip


def runs_while_loading(place):
    """A __setstate__, which torch runs while it loads the file."""

    state = """
  def __getstate__(self: {name}) -> Tuple[int, bool]:
    return (1, False)
  def __setstate__(self: {name}, state: Tuple[int, bool]) -> None:
    written = torch.from_file("{place}", True, 1024)
    self.training = (state)[1]
"""

    def attacked(code):
        text = code.decode()
        name = text.partition("self: ")[2].partition(",")[0]
        return (text + state.format(name=name, place=place)).encode()

    return edited(straight(), ".py", attacked)


def runs_in_a_default_argument(place):
    """An operator as the default of an argument, which torch runs while it loads the file."""
    data = straight()
    return edited(
        data,
        ".py",
        lambda code: code.replace(
            b"initial_covariance: Optional[Tensor]=None",
            b'initial_covariance: Tensor=torch.from_file("%s", True, 1024)' % place.encode(),
        ),
    )


def bomb(megabytes=300):
    """A small file that unpacks to 300 MB of zeros, or any other size."""
    data = straight()
    records = records_of(data)
    folder = next(iter(records)).partition("/")[0]
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, content in records.items():
            archive.writestr(name, content)
        with archive.open(f"{folder}/data/0", "w", force_zip64=True) as record:
            for _ in range(megabytes):
                record.write(bytes(1 << 20))
    return buffer.getvalue()


def bomb_that_lies():
    """A bomb whose directory says that it is small."""
    data = bytearray(bomb(20))
    size = struct.pack("<I", 20 << 20)
    while size in data:
        at = data.index(size)
        data[at : at + 4] = struct.pack("<I", 1000)
    return bytes(data)


def many_records(count=100_000):
    """Bytes that look like the directory of an archive of very many records."""
    return packed({"a/data/0": b"PK\x01\x02" * (count - 1)})


def two_of_a_name():
    """Two task descriptions, of which each reader takes another."""
    data = straight()
    buffer = io.BytesIO(data)
    name = next(name for name in records_of(data) if name.endswith(TASK_FILE))
    with zipfile.ZipFile(buffer, "a") as archive:
        archive.writestr(name.replace("task", "TASK"), b"{}")
    return buffer.getvalue()


def not_a_number():
    """Weights of which one is NaN."""

    class Weighted(StraightModel):
        def __init__(self):
            super().__init__(2, HORIZON, MODES, 0.2)
            self.weight = torch.nn.Parameter(torch.tensor([1.0, float("nan"), 2.0]))

    return saved(torch.jit.script(Weighted()), TASK)


def answers_nan():
    """A model whose answer is NaN."""
    return hostile(["features = torch.mul(features, torch.log(torch.neg(torch.ones([1]))))"])


def a_pickle():
    """A pickle that runs a command when it is loaded."""

    class Command:
        def __reduce__(self):
            return (os.system, ("echo hostile",))

    return pickle.dumps(Command())


def of_another_torch():
    """A file of a version of the format that no torch has yet."""
    data = straight()
    return edited(data, "/version", lambda _: b"999\n")


def of_another_schema():
    """A task description of a later version."""
    return with_task(straight(), schema_version=99)


def of_a_huge_task():
    """A task description with a horizon of a billion steps."""
    return with_task(straight(), horizon_steps=10**9)


def with_a_forged_hash():
    """A task description that claims a hash of another content."""
    return with_task(straight(), content_sha256="0" * 64)


def nested_json():
    """A task description nested deeper than a reader can follow."""
    return edited(straight(), TASK_FILE, lambda _: b'{"a":' * 100_000)
