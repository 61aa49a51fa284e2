# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""CMake's view of the installed package: which versions a request finds."""

import re
import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]
CMAKE = shutil.which("cmake")

pytestmark = pytest.mark.skipif(CMAKE is None, reason="cmake is not installed")


def found(prefix, requests, folder):
    """Return the version that each request finds in a prefix, empty for none."""
    lines = ["cmake_minimum_required(VERSION 3.19)", "project(consumer NONE)"]
    for number, request in enumerate(requests):
        lines += [
            "unset(mtpgo_ros_DIR CACHE)",
            "unset(mtpgo_ros_VERSION)",
            f"find_package(mtpgo_ros {request} QUIET)",
            "if(NOT mtpgo_ros_FOUND)",
            '  set(mtpgo_ros_VERSION "")',
            "endif()",
            f'message(STATUS "request {number}: <${{mtpgo_ros_VERSION}}>")',
        ]
    (folder / "CMakeLists.txt").write_text("\n".join(lines))
    done = subprocess.run(
        [CMAKE, "-S", folder, "-B", folder / "out", f"-DCMAKE_PREFIX_PATH={prefix}"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return re.findall(r"request \d+: <(.*)>", done.stdout)


@pytest.fixture
def prefix(tmp_path):
    """A prefix as setup.py fills it."""
    share = tmp_path / "prefix" / "share" / "mtpgo_ros"
    shutil.copytree(ROOT / "cmake", share / "cmake")
    shutil.copytree(ROOT / "include", tmp_path / "prefix" / "include" / "mtpgo_ros")
    shutil.copy(ROOT / "package.xml", share)
    return tmp_path / "prefix"


def test_the_version_is_that_of_the_manifest(prefix, tmp_path):
    version = ElementTree.parse(ROOT / "package.xml").getroot().findtext("version")
    major, minor, _ = version.split(".")
    requests = ["", major, f"{major}.{minor}", f"{version} EXACT", f"{int(major) + 1}"]
    assert found(prefix, requests, tmp_path) == [version] * 4 + [""]


@pytest.mark.parametrize(
    ("version", "satisfied", "refused"),
    [
        (
            "1.4.2",
            ["1", "1.2", "1.4", "1.4.2", "1.4.2 EXACT", "1.2...<2", "1...1.4.2", "0.9...3"],
            ["0.9", "1.4.3", "1.5", "2", "1.4 EXACT", "1...<1.4.2", "1.5...3"],
        ),
        ("0.3.1", ["0", "0.3", "0.3.0", "0.2...<1"], ["0.2", "0.3.2", "0.4", "1", "0.1...<0.3"]),
    ],
)
def test_a_version_satisfies_what_is_compatible(prefix, tmp_path, version, satisfied, refused):
    manifest = prefix / "share" / "mtpgo_ros" / "package.xml"
    text = re.sub(r"<version>.*</version>", f"<version>{version}</version>", manifest.read_text())
    manifest.write_text(text)
    results = found(prefix, satisfied + refused, tmp_path)
    assert results == [version] * len(satisfied) + [""] * len(refused)
