# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What pip and colcon install, tested on a copy of the source tree."""

import itertools
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import declared
import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = [
    "models",
    "msg_adapters",
    "mtpgo_core",
    "mtpgo_ros",
    "mtpgo_training",
    "resource",
    "config",
    "launch",
    "include",
    "cmake",
    "package.xml",
    "setup.py",
    "setup.cfg",
    "pyproject.toml",
    "README.md",
    "MANIFEST.in",
]
EXECUTABLES = ("predictor", "replay", "record", "risk", "mtpgo")


def run(*command: str, cwd: Path, **environment: str) -> str:
    """Run a command that must succeed and return its output."""
    env = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "AMENT_PREFIX_PATH")}
    done = subprocess.run(
        command, cwd=cwd, env=env | environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def shipped(folder: str, share: str) -> set[str]:
    """Return the files of a source folder as paths below ``share/mtpgo_ros``."""
    return {
        f"{share}/{path.relative_to(ROOT / folder).as_posix()}"
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }


@pytest.fixture(scope="module")
def tree(tmp_path_factory) -> Path:
    """A copy of the sources, so that building writes nothing into the checkout."""
    copy = tmp_path_factory.mktemp("source") / "mtpgo_ros"
    copy.mkdir()
    for name in SOURCES:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, copy / name)
    return copy


@pytest.fixture(scope="module")
def prefix(tree, tmp_path_factory) -> Path:
    """A virtual environment with this package, installed by pip without dependencies."""
    prefix = tmp_path_factory.mktemp("prefix")
    run(sys.executable, "-m", "venv", "--without-pip", str(prefix), cwd=tree)
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check")
    wheels = tree.parent / "wheels"
    # The wheel is built from the source distribution: what is missing there is missing here.
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", str(wheels), ".", cwd=tree)
    (wheel,) = wheels.glob("*.whl")
    assert list(wheels.glob("*.tar.gz"))
    python = str(prefix / "bin" / "python")
    run(*pip, "--python", python, "install", "-q", "--no-deps", str(wheel), cwd=tree)
    return prefix


def check_share(prefix: Path) -> None:
    """Check that the ament marker and all data files are installed."""
    share = prefix / "share" / "mtpgo_ros"
    assert (prefix / "share/ament_index/resource_index/packages/mtpgo_ros").is_file()
    assert (share / "package.xml").read_text() == (ROOT / "package.xml").read_text()
    expected = (
        shipped("resource/weights", "weights")
        | shipped("resource/recordings", "recordings")
        | shipped("config", "config")
        | shipped("launch", "launch")
        | shipped("cmake", "cmake")
        | shipped("include", "../../include/mtpgo_ros")
    )
    missing = sorted(name for name in expected if not (share / name).is_file())
    assert not missing


def check_template(reports: Path) -> None:
    """Check that the template of the report is installed next to the code that reads it."""
    template = (ROOT / "mtpgo_training/reports/page.html.j2").read_text()
    assert (reports / "page.html.j2").read_text() == template


def test_pip_installs_executables_and_data(prefix):
    check_share(prefix)
    (reports,) = prefix.rglob("mtpgo_training/reports")
    check_template(reports)
    for name in EXECUTABLES:
        assert os.access(prefix / "bin" / name, os.X_OK)
        assert os.access(prefix / "lib" / "mtpgo_ros" / name, os.X_OK)


def test_launchers_start_the_executable_of_their_own_environment(prefix):
    (prefix / "bin" / "predictor").write_text('#!/bin/sh\necho "started with $*"\n')
    link = prefix / "elsewhere"
    link.symlink_to(prefix / "lib" / "mtpgo_ros" / "predictor")
    assert run(str(link), "a b", "c", cwd=Path("/")) == "started with a b c\n"


def test_installed_code_finds_its_resources(prefix):
    code = (
        "from mtpgo_core.resources import find_resource, source_tree;"
        "print(source_tree(), find_resource('package.xml'))"
    )
    # The temporary environment has no dependencies of the core; this code needs none.
    out = run(str(prefix / "bin" / "python"), "-c", code, cwd=Path("/"))
    assert out.split() == ["None", str(prefix / "share/mtpgo_ros/package.xml")]


def test_installed_configurations_are_found_by_name_from_any_directory(prefix):
    code = (
        "from mtpgo_training.training.recipes.named_configs import find_config;"
        "print(find_config('default'), find_config('mtp-go2-s-round'))"
    )
    out = run(str(prefix / "bin" / "python"), "-c", code, cwd=Path("/"))
    folder = prefix / "share/mtpgo_ros/config/training"
    expected = [str(folder / "default.yaml"), str(folder / "paper" / "mtp-go2-s-round.yaml")]
    assert out.split() == expected


def test_a_missing_resource_is_an_error_in_one_sentence():
    from mtpgo_core.errors import ConfigurationError
    from mtpgo_core.resources import find_resource

    with pytest.raises(ConfigurationError, match=r"weights/none\.pt is not among the files"):
        find_resource("weights", "none.pt")


@pytest.mark.parametrize("options", [(), ("--symlink-install",)], ids=["plain", "symlink"])
def test_colcon_builds_it(tree, tmp_path, options):
    colcon = shutil.which("colcon", path=f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    assert colcon, "colcon is not installed, expected from requirements/development.txt"
    run(
        *(colcon, "--log-base", str(tmp_path / "log"), "build", *options),
        *("--build-base", str(tmp_path / "build"), "--install-base", str(tmp_path / "install")),
        cwd=tree,
        COLCON_PYTHON_EXECUTABLE=sys.executable,
        PATH=f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    )
    prefix = tmp_path / "install" / "mtpgo_ros"
    check_share(prefix)
    for name in EXECUTABLES:
        assert os.access(prefix / "lib" / "mtpgo_ros" / name, os.X_OK)
    out = run(
        *("bash", "-c"),
        f"source {tmp_path}/install/setup.bash; cd /; echo $AMENT_PREFIX_PATH; {sys.executable} "
        "-c 'import mtpgo_core, importlib.util as u; print(mtpgo_core.__file__, "
        'u.find_spec("mtpgo_ros").origin, u.find_spec("mtpgo_training.reports").origin)\'',
        cwd=tree,
    )
    ament, *modules = out.split()
    assert ament == str(prefix)
    for module in map(Path, modules):
        assert module.is_relative_to(tmp_path)
        assert module.resolve().is_relative_to(tree) == bool(options)
    check_template(Path(modules[-1]).parent)
    if options:  # the folder of a symbolic link is not that of its target
        build_with_cmake(tmp_path)


CMAKE_PROJECT = """
cmake_minimum_required(VERSION 3.16)
project(consumer CXX)
find_package(mtpgo_ros {version} REQUIRED)
add_executable(consumer consumer.cpp)
target_link_libraries(consumer mtpgo_ros::predictions)
"""


def build_with_cmake(workspace: Path) -> None:
    """Build a C++ consumer of the installed header as the documentation says."""
    if shutil.which("cmake") is None or shutil.which("c++") is None:
        return
    consumer = workspace / "consumer"
    consumer.mkdir()
    version = ElementTree.parse(ROOT / "package.xml").getroot().findtext("version")
    (consumer / "CMakeLists.txt").write_text(CMAKE_PROJECT.format(version=version))
    (consumer / "consumer.cpp").write_text(
        '#include "mtpgo_ros/predictions.hpp"\n'
        "int main() {return static_cast<int>(mtpgo_ros::Predictions().agents.size());}\n"
    )
    script = f"source {workspace}/install/setup.bash; cmake -S . -B out && cmake --build out"
    run("bash", "-c", f"{script} && out/consumer", cwd=consumer)


def test_ros_tools_accept_the_manifest():
    manifest = ElementTree.parse(ROOT / "package.xml").getroot()
    email = manifest.find("maintainer").attrib["email"]
    # With an address that catkin_pkg rejects, colcon treats this as a plain Python package.
    assert re.fullmatch(
        r"[\w%+-]+(\.[\w%+-]+)*@[a-zA-Z0-9-]+(\.[a-zA-Z0-9-]+)*\.[a-zA-Z]{2,}", email
    )
    assert manifest.findtext("export/build_type") == "ament_python"
    version = manifest.findtext("version")
    assert re.fullmatch(r"\d+\.\d+\.\d+", version)
    assert "## [" in (ROOT / "CHANGELOG.md").read_text()


def test_everything_is_pinned_and_the_pins_agree():
    direct, lock = declared.pins(), declared.pins("lock.txt")
    lines = (ROOT / "requirements" / "development.txt").read_text().splitlines()
    assert len(direct) == sum(bool(x) and not x.startswith("#") for x in lines), "a line is no pin"
    assert direct["torch"] == "2.13.0"
    assert direct["ros-rclpy"] == "7.1.6"
    assert {k: lock.get(k, v) for k, v in direct.items()} == direct


def test_declared_ranges_admit_the_pinned_versions():
    direct = declared.pins()
    every = [*declared.requirements(), *itertools.chain(*declared.extras().values())]
    names = {r.name.lower() for r in every}
    assert {"numpy", "torch", "torch-geometric", "mcap", "rosbags", "ros-rclpy"} <= names
    for requirement in every:
        version = direct[requirement.name.lower()]
        assert version in requirement.specifier, f"{requirement} does not admit {version}"


def test_declared_ranges_end_before_the_next_major_version():
    # Versions that count years or quarters, or name a release of ROS, and tools of developers.
    open_ended = {"cryptography", "distributed", "pyarrow"}
    pinned = declared.pins()
    every = [*declared.requirements()]
    for extra, packages in declared.extras().items():
        every += packages if extra not in ("development", "test", "ros", "docs") else []
    for requirement in every:
        name = requirement.name.lower()
        if name in open_ended:
            continue
        release = [int(part) for part in pinned[name].split(".")[:2]]
        following = f"{release[0] + 1}" if release[0] else f"0.{release[1] + 1}"
        assert pinned[name] in requirement.specifier, requirement
        assert following not in requirement.specifier, f"{requirement} admits {following}"
