# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command line without any extra but ``ros``: the packages of the other extras are hidden.

``make small`` does the same in an environment of its own, with the real node.
"""

import ast
import importlib.metadata
import json
import os
import subprocess
import sys
from pathlib import Path

import declared
import pytest

from mtpgo_training.cli import EXTRA_MODULES

ROOT = Path(__file__).resolve().parents[1]

HIDE = """
import sys

class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in HIDDEN:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

HIDDEN = set(sys.argv[1].split(","))
sys.meta_path.insert(0, Hidden())
sys.path.insert(0, sys.argv[2])
"""

RUN = """
import contextlib, importlib, io, json, pkgutil, traceback
import mtpgo_training.commands
from mtpgo_training.cli import COMMANDS, main

results = {"not importable": {}, "lines": []}
names = [f"mtpgo_training.commands.{name}" for name in COMMANDS]
for name in [*names, "mtpgo_training.demo.demo_pipeline"]:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        results["not importable"][name] = str(error)

for line in json.loads(sys.argv[3]):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = main(line)
        except SystemExit as ended:
            status = ended.code
        except BaseException:
            status = traceback.format_exc()
    results["lines"].append([status, out.getvalue(), err.getvalue()])

from pathlib import Path
from mtpgo_training.demo.demo_pipeline import _draw
results["picture"] = _draw(["a moment"], Path("x.png"))
print(json.dumps(results))
"""


def modules_of_extras() -> dict[str, str]:
    """Return the extra by top-level module, of the packages that are in no other installation."""
    always = {one.name.lower() for one in declared.requirements()}
    by_package: dict[str, str] = {}
    for extra, packages in declared.extras().items():
        for one in packages if extra not in ("development", "test", "ros") else ():
            by_package.setdefault(one.name.lower(), extra)
    found = {}
    for module, packages in importlib.metadata.packages_distributions().items():
        for package in packages:
            extra = by_package.get(package.lower())
            if extra is not None and package.lower() not in always:
                found[module] = extra
    return found


def write_tables(folder: Path) -> Path:
    """Write a recording of one car in inD layout."""
    folder.mkdir()
    (folder / "01_tracksMeta.csv").write_text(
        "recordingId,trackId,initialFrame,finalFrame,numFrames,width,length,class\n"
        "1,0,0,1,2,1.9,4.5,car\n"
    )
    (folder / "01_recordingMeta.csv").write_text(
        "recordingId,locationId,frameRate,speedLimit,duration\n1,1,10,13.9,0.1\n"
    )
    heads = "recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length,"
    heads += "xVelocity,yVelocity,xAcceleration,yAcceleration,lonVelocity,latVelocity,"
    heads += "lonAcceleration,latAcceleration\n"
    row = "1,0,{0},{0},{0},2.0,0.0,1.9,4.5,10.0,0.0,0.0,0.0,10.0,0.0,0.0,0.0\n"
    (folder / "01_tracks.csv").write_text(heads + row.format(0) + row.format(1))
    return folder


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    """What the command lines did, in one process: its import of torch takes seconds."""
    folder = tmp_path_factory.mktemp("small")
    data, bag = str(write_tables(folder / "data")), str(folder / "a.mcap")
    lines = {
        "demo --help": ["demo", "--help"],
        "convert tables": ["convert", "ind", data, "-o", bag],
        "convert a bag": ["convert", "bag", bag, "-o", str(folder / "b.mcap")],
        "data": ["data", data, "--layout", "ind"],
        "info": ["info", "default"],
        "layouts": ["layouts", "--namespace", "robot1", "-o", str(folder / "layouts")],
        "train --help": ["train", "--help"],
        "export --help": ["export", "--help"],
        "benchmark --help": ["benchmark", "--help"],
        "view --help": ["view", "--help"],
        "curve": ["curve", str(folder), "-o", str(folder / "x.png")],
    }
    hidden = ",".join(modules_of_extras())
    arguments = [hidden, str(ROOT), json.dumps(list(lines.values()))]
    done = subprocess.run(
        [sys.executable, "-c", HIDE + RUN, *arguments],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        env=dict(os.environ),
    )
    assert done.returncode == 0, done.stderr
    results = json.loads(done.stdout.splitlines()[-1])
    results["lines"] = dict(zip(lines, results["lines"], strict=True))
    results["folder"] = folder
    return results


def test_the_large_packages_of_the_extras_are_hidden():
    hidden = modules_of_extras()
    assert {"lightning_fabric", "matplotlib", "scipy", "tensorboard", "torch_geometric"} <= set(
        hidden
    )
    assert not {"numpy", "pandas", "torch", "rclpy"} & set(hidden)


def test_no_command_imports_an_extra_before_it_runs(outcome):
    assert outcome["not importable"] == {}


@pytest.mark.parametrize(
    "line",
    [
        "demo --help",
        "convert tables",
        "convert a bag",
        "data",
        "info",
        "layouts",
        "train --help",
        "export --help",
        "benchmark --help",
        "view --help",
    ],
)
def test_a_command_works_without_the_extras(outcome, line):
    status, out, err = outcome["lines"][line]
    assert (status, err) == (0, "")
    assert out


def test_the_written_files_are_there(outcome):
    names = {path.name for path in outcome["folder"].iterdir()}
    assert {"a.mcap", "b.mcap", "layouts"} <= names


def test_a_command_that_needs_an_extra_names_it_in_one_line(outcome):
    status, out, err = outcome["lines"]["curve"]
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert "pip install 'mtpgo_ros[training]'" in err


def test_the_demo_says_why_there_is_no_picture(outcome):
    assert outcome["picture"] == (
        "(no picture: matplotlib is missing, it comes with the extra 'training')"
    )


def test_every_module_of_an_extra_has_its_extra_in_the_error_message():
    extra_of = modules_of_extras()
    imported = set()
    for path in (ROOT / "mtpgo_training").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                imported.add((node.module or "").partition(".")[0])
    used = {module: extra for module, extra in extra_of.items() if module in imported}
    assert {"matplotlib": "training", "pyarrow": "datasets"}.items() <= used.items()
    assert used.items() <= EXTRA_MODULES.items()
