# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The C++ header against the Python decoder: the same bytes give the same numbers and refusals."""

import dataclasses
import os
import re
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from msg_adapters.predictions import (
    POINT,
    Pose2,
    at_times,
    mixture_moments,
    most_probable_mode,
    prediction_from_cdr,
    prediction_to_pointcloud2,
    to_frame,
)
from msg_adapters.registry import INPUTS
from mtpgo_core.errors import MessageError
from mtpgo_core.schema import CalibrationStage, Source

ROOT = Path(__file__).resolve().parents[3]
MESSAGES = ROOT / "docs" / "messages.md"
TYPE = "sensor_msgs/msg/PointCloud2"
STEP = POINT.itemsize
FLAGS = ("-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror")
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
COMPILER = shutil.which("g++") or shutil.which("clang++")
TIMES = [-0.1, 0.0, 0.1, 0.2, 0.33, 0.5, 1.0, 1.1]

needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C++ compiler is installed")
pytestmark = needs_compiler


def compile_cpp(*arguments):
    """Compile; return the compiler's complaints, empty for success."""
    command = [COMPILER, *FLAGS, f"-I{ROOT / 'include'}", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return "" if done.returncode == 0 else done.stderr or "failed"


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """The dumping program, with sanitizers where the compiler has them."""
    folder = tmp_path_factory.mktemp("cpp")
    empty, program = folder / "empty.cpp", folder / "dump"
    empty.write_text("int main() { return 0; }\n")
    has_sanitizers = not compile_cpp(empty, *SANITIZERS, "-o", str(folder / "empty"))
    options = SANITIZERS if has_sanitizers else ()
    source = Path(__file__).with_name("dump_predictions.cpp")
    complaints = compile_cpp(source, *options, "-o", str(program))
    assert not complaints, complaints
    return program


@pytest.fixture
def dumps(program, tmp_path):
    """What the program prints for some byte strings: an error, or lists of numbers by name."""

    def run(contents, program=program):
        names = []
        for number, content in enumerate(contents):
            names.append(str(tmp_path / f"{number}.cdr"))
            Path(names[-1]).write_bytes(content)
        done = subprocess.run([program, *names], capture_output=True, check=False)
        assert done.returncode == 0, done.stderr.decode()[-3000:]
        parts = re.split(rb"^file .*\n", done.stdout, flags=re.MULTILINE)[1:]
        assert len(parts) == len(names)
        return [parsed(part.decode("utf-8", "replace")) for part in parts]

    return run


def parsed(text):
    if text.startswith("error"):
        return text
    found = {}
    for line in text.splitlines():
        name, _, rest = line.partition(" ")
        found.setdefault(name, []).append(rest)
    numbers = {
        name: np.array([[float(number) for number in line.split()] for line in lines])
        for name, lines in found.items()
        if name != "frame"
    }
    return {**numbers, "frame": found["frame"][0], "stamp": int(found["stamp"][0])}


def state_rows(mean, yaw, covariance):
    """x, y, vx, vy, yaw, xx, xy, yy of [...] states, one row each."""
    upper = covariance.reshape(*covariance.shape[:-2], 4)[..., [0, 1, 3]]
    return np.concatenate([mean, yaw[..., None], upper], axis=-1).reshape(-1, 8)


def assert_same(found, data):
    """Compare the program's numbers with the Python decoder's of the same bytes."""
    wanted = prediction_from_cdr(data)
    assert found["stamp"] == wanted.stamp_ns
    assert found["frame"] == wanted.frame_id
    n, modes, steps = wanted.yaw.shape
    assert found["shape"].astype(int).tolist() == [[n, modes, steps]]
    if n == 0:
        return

    def same(name, values, **tolerance):
        tolerance = {"rtol": 0.0, "atol": 0.0, **tolerance}
        np.testing.assert_allclose(found[name], values, err_msg=name, **tolerance)

    same("time", wanted.time_s[:, None])
    agents = [wanted.agent_class, wanted.source, wanted.calibration, wanted.z, wanted.size]
    agents = np.column_stack([wanted.key, *agents, most_probable_mode(wanted), np.arange(n)])
    same("agent", agents)
    same("factor", wanted.sigma_factor_50.reshape(-1, 1))
    same("weight", wanted.weight.reshape(-1, 1))
    same("state", state_rows(wanted.mean, wanted.yaw, wanted.covariance))
    moved = to_frame(wanted, Pose2(100.0, -20.0, 2.5), "other")
    close = {"rtol": 1e-9, "atol": 1e-9}
    same("moved", state_rows(moved.mean, moved.yaw, moved.covariance), **close)
    at = at_times(wanted, TIMES)
    rows = state_rows(at.mean, at.yaw, at.covariance)
    rows[np.isnan(rows[:, 0])] = np.nan
    same("at", rows, **close)
    mean, covariance = mixture_moments(wanted, [0.1, 0.33, 1.0, 1.1])
    same("mixture", state_rows(mean, np.full(mean.shape[:2], np.nan), covariance), **close)


def big_endian(message):
    """The same cloud with big-endian points."""
    kinds = {2: 1, 6: 4, 7: 4, 8: 8}
    data = np.frombuffer(bytes(message.data), np.uint8).reshape(-1, message.point_step).copy()
    for field in message.fields:
        place = slice(field.offset, field.offset + kinds[field.datatype])
        data[:, place] = data[:, place][:, ::-1]
    return dataclasses.replace(message, data=data.reshape(-1), is_bigendian=True)


def lacking(message, *names):
    """The cloud without some of its fields."""
    fields = [field for field in message.fields if field.name not in names]
    return dataclasses.replace(message, fields=fields)


def without(message, rows):
    """The cloud without some of its points."""
    data = np.frombuffer(bytes(message.data), np.uint8).reshape(-1, message.point_step)
    data = np.delete(data, rows, axis=0)
    return dataclasses.replace(message, data=data.reshape(-1), width=len(data), row_step=data.size)


def variants(prediction, offline):
    """Clouds that hold predictions in every form that the layout allows."""
    whole = prediction_to_pointcloud2(prediction, offline)
    far = prediction.mean + np.array([691_000.123, 5_334_000.456, 0.0, 0.0])
    far_off = dataclasses.replace(prediction, mean=far)
    shuffled = np.frombuffer(bytes(whole.data), f"V{STEP}").copy()
    np.random.default_rng(5).shuffle(shuffled)
    rows = np.zeros((4, 15 * STEP + 16), np.uint8)  # organised and padded
    rows[:, : 15 * STEP] = np.frombuffer(bytes(whole.data), np.uint8).reshape(4, -1)
    return {
        "whole": whole,
        "far from the origin": prediction_to_pointcloud2(far_off, offline),
        "big-endian points": big_endian(whole),
        "shuffled": dataclasses.replace(whole, data=shuffled.view(np.uint8)),
        "points missing": without(whole, [0, 7, 8, 59]),
        "a mode missing": without(whole, [0, 1, 2, 3, 4, 44]),
        "a step missing": without(whole, list(range(2, 60, 5))),
        "one point": without(whole, list(range(1, 60))),
        "no points": without(whole, list(range(60))),
        "first layout": lacking(
            whole, "sigma_factor_50", "calibration", "x_rest", "y_rest", "length", "width"
        ),
        "without rests": lacking(whole, "x_rest", "y_rest", "length"),
        "padded rows": dataclasses.replace(
            whole, height=4, width=15, row_step=rows.shape[1], data=rows.reshape(-1)
        ),
    }


def test_clouds_of_predictions_give_the_same_numbers(prediction, offline, typestore, dumps):
    messages = variants(prediction, offline)
    contents = [
        bytes(typestore.serialize_cdr(message, TYPE, little_endian=little))
        for little in (True, False)
        for message in messages.values()
    ]
    for name, found, data in zip([*messages] * 2, dumps(contents), contents, strict=True):
        assert not isinstance(found, str), f"{name}: {found}"
        assert_same(found, data)


def contradictions(prediction, states, offline):
    """Clouds that are refused, and a word of the C++ error."""
    whole = prediction_to_pointcloud2(prediction, offline)
    data = np.frombuffer(bytes(whole.data), np.uint8)
    fields = whole.fields

    def changed(number, **values):
        edited = [dataclasses.replace(f) for f in fields]
        for name, value in values.items():
            setattr(edited[number], name, value)
        return dataclasses.replace(whole, fields=edited)

    far_apart = data.reshape(-1, STEP)[:40].copy()
    far_apart[:, 61:63] = 255
    far_apart[:, 44] = np.arange(40)
    return {
        "foreign": (INPUTS["pointcloud2"].from_states(states, offline), "lacks the field"),
        "no fields": (dataclasses.replace(whole, fields=[]), "lacks the field"),
        "wrong byte order": (dataclasses.replace(whole, is_bigendian=True), "is_bigendian"),
        "other wrong order": (
            dataclasses.replace(big_endian(whole), is_bigendian=False),
            "is_bigendian",
        ),
        "too little data": (dataclasses.replace(whole, data=data[:-1]), "bytes of data"),
        "too many points": (dataclasses.replace(whole, width=2**32 - 1), "bytes of data"),
        "huge": (
            dataclasses.replace(whole, width=2**32 - 1, height=2**32 - 1, row_step=2**32 - 1),
            "row_step",
        ),
        "rows overlap": (dataclasses.replace(whole, height=2, width=30, row_step=8), "row_step"),
        "point_step": (dataclasses.replace(whole, point_step=70), "point_step"),
        "no point_step": (
            dataclasses.replace(whole, point_step=0, fields=[]),
            "point_step 0",
        ),
        "offset": (changed(3, offset=2**32 - 1), "ends at byte"),
        "datatype": (changed(0, datatype=9), "datatype 9"),
        "mode as float": (changed(16, datatype=7, offset=60), "no predictions"),
        "id as float": (changed(11, datatype=7), "no predictions"),
        "two of a name": (changed(1, name="x"), "two fields of the name 'x'"),
        "a point twice": (
            dataclasses.replace(whole, data=np.concatenate([data[:STEP]] * 2), width=2),
            "same agent",
        ),
        "few points of many": (
            dataclasses.replace(whole, data=far_apart.reshape(-1), width=40),
            "too few",
        ),
    }


def test_clouds_that_are_refused_are_refused_by_both(
    prediction, states, offline, typestore, dumps
):
    cases = contradictions(prediction, states, offline)
    contents = [bytes(typestore.serialize_cdr(message, TYPE)) for message, _ in cases.values()]
    for name, (_, words), data, found in zip(
        cases, cases.values(), contents, dumps(contents), strict=True
    ):
        assert isinstance(found, str), name
        assert words in found, (name, found)
        with pytest.raises(MessageError):
            prediction_from_cdr(data)


def test_bytes_that_are_cut_off_or_damaged_are_refused_or_read_alike(
    prediction, offline, typestore, dumps
):
    whole = bytes(typestore.serialize_cdr(prediction_to_pointcloud2(prediction, offline), TYPE))
    start = len(whole) - 60 * STEP - 1
    rng = np.random.default_rng(11)
    contents = [whole[:length] for length in (*range(0, start, 7), start + 100, len(whole) - 1)]
    contents += [b"\x00\x03" + whole[2:], b"\x01" + whole[1:]]
    for _ in range(400):
        damaged = bytearray(whole)
        for place in rng.integers(0, start if rng.random() < 0.7 else len(whole), size=2):
            damaged[place] = rng.choice([0, 1, 255, rng.integers(256)])
        contents.append(bytes(damaged))
    readable = 0
    for found, data in zip(dumps(contents), contents, strict=True):
        if isinstance(found, str):
            with pytest.raises(MessageError):
                prediction_from_cdr(data)
        else:
            readable += 1
            assert found["shape"][0].tolist() == list(prediction_from_cdr(data).yaw.shape)
    assert 50 < readable < len(contents) - 150


def message_headers():
    """Options with the include folders of the ROS wheels, else of a sourced ROS."""
    prefixes = [sys.prefix, *os.environ.get("AMENT_PREFIX_PATH", "").split(":")]
    for include in (Path(prefix) / "include" for prefix in prefixes if prefix):
        if (include / "sensor_msgs/sensor_msgs/msg/point_cloud2.hpp").is_file():
            return [f"-isystem{folder}" for folder in sorted(include.iterdir()) if folder.is_dir()]
    pytest.skip("the C++ headers of sensor_msgs are not in this environment")


def test_the_message_class_of_ros_gives_the_same(prediction, offline, typestore, dumps, tmp_path):
    program = tmp_path / "dump"
    (example,) = re.findall(r"```cpp\n(.*?)```", MESSAGES.read_text("utf-8"), re.DOTALL)
    (tmp_path / "example.cpp").write_text(example)
    sources = (Path(__file__).with_name("dump_predictions.cpp"), tmp_path / "example.cpp")
    options = ("-DWITH_MESSAGES", *message_headers(), "-o", str(program))
    complaints = compile_cpp(*sources, *options)
    assert not complaints, complaints
    whole = bytes(typestore.serialize_cdr(prediction_to_pointcloud2(prediction, offline), TYPE))
    cut = struct.pack("<4sI", whole[:4], 0)
    found, refused = dumps([whole, cut], program)
    assert_same(found, whole)
    assert "is cut off" in refused


@pytest.mark.parametrize(
    ("name", "values"), [("Source", Source), ("Calibration", CalibrationStage)]
)
def test_the_header_names_every_value(name, values):
    text = (ROOT / "include" / "mtpgo_ros" / "predictions.hpp").read_text("utf-8")
    (body,) = re.findall(rf"enum {name} : std::uint8_t\n{{\n(.*?)}};", text, re.DOTALL)
    named = dict(re.findall(rf"  {name.upper()}_(\w+) = (\d+),", body))
    published = {value.name: str(value.value) for value in values}
    published.pop("OTHER", None)  # of converted messages, never in a cloud
    assert named == published


def test_an_older_standard_is_named():
    header = ROOT / "include" / "mtpgo_ros" / "predictions.hpp"
    told = compile_cpp("-fsyntax-only", "-x", "c++", "-std=c++14", header)
    assert "predictions.hpp needs C++17 or later" in told.splitlines()[0] + told.splitlines()[1]
    assert not compile_cpp("-fsyntax-only", "-x", "c++-header", "-std=c++20", header)
