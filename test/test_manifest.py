# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""package.xml, the changelog of ROS' release tools, rosdep's rules and the quality declaration."""

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
MANIFEST = ElementTree.parse(ROOT / "package.xml").getroot()
ORDER = ("name", "version", "description", "maintainer", "license", "url", "author")
"""Elements that the schema of format 3 wants first, in this order; dependencies follow, then
export."""


def names(kind: str) -> set[str]:
    """Return the packages of one kind of dependency."""
    return {element.text for element in MANIFEST.findall(kind)}


def test_the_elements_have_the_order_of_format_3():
    assert MANIFEST.attrib == {"format": "3"}
    tags = [element.tag for element in MANIFEST]
    kinds = ("exec_depend", "test_depend")
    ranks = [ORDER.index(t) if t in ORDER else len(ORDER) + (t not in kinds) for t in tags]
    assert ranks == sorted(ranks), tags
    assert tags[-1] == "export"
    assert set(tags) <= {*ORDER, *kinds, "export"}
    assert (ROOT / MANIFEST.find("license").attrib["file"]).is_file()


def test_catkin_pkg_reads_the_manifest_without_a_warning():
    package = pytest.importorskip("catkin_pkg.package")
    warnings: list[str] = []
    found = package.parse_package(str(ROOT / "package.xml"), warnings=warnings)
    assert not warnings
    assert found.get_build_type() == "ament_python"


def test_every_ros_package_that_is_imported_is_declared():
    sources = [*(ROOT / "mtpgo_ros").rglob("*.py"), *(ROOT / "launch").rglob("*.py")]
    text = "\n".join(path.read_text(encoding="utf-8") for path in sources)
    imported = set(re.findall(r"^\s*(?:from|import) (\w+)", text, re.MULTILINE))
    ros = {
        name
        for name in imported
        if name.endswith(("_msgs", "_interfaces"))
        or name in ("rclpy", "launch", "launch_ros", "ament_index_python")
    }
    assert "rclpy" in ros
    assert ros <= names("exec_depend")
    assert "launch_xml" in names("exec_depend"), "reads launch/*.launch.xml"


def test_rosdep_has_a_rule_for_every_package_by_pip():
    rules = yaml.safe_load((ROOT / "requirements" / "rosdep.yaml").read_text())
    by_pip = {name for name in names("exec_depend") if name.endswith(("-pip", "-support"))}
    assert set(rules) == by_pip
    installed = set()
    for rule in rules.values():
        assert rule["ubuntu"] == rule["debian"]
        installed.update(rule["ubuntu"]["pip"]["packages"])
    lines = (ROOT / "requirements" / "robot.txt").read_text().splitlines()
    robot = {re.split("[>=<]", line)[0] for line in lines if line and line[0] != "#"}
    brought = {"mcap": "mcap-ros2-support", "lz4": "rosbags", "backports.zstd": "rosbags"}
    brought["ruamel.yaml"] = "rosbags"
    by_apt = {name for name in robot if f"python3-{name}" in names("exec_depend")}
    assert {"filelock", "pandas", "platformdirs", "tqdm"} <= by_apt
    assert {brought.get(name, name) for name in robot - by_apt} == installed


def test_release_tools_read_the_changelog():
    changelog = pytest.importorskip("catkin_pkg.changelog")
    version = pytest.importorskip("catkin_pkg.package_version")
    text = (ROOT / "CHANGELOG.rst").read_text(encoding="utf-8")
    name = MANIFEST.findtext("name")
    found = changelog.get_changelog_from_path(ROOT / "CHANGELOG.rst", name)
    released = [entry[0] for entry in found.foreach_version()]
    ours = re.findall(
        r"^## \[(\d+\.\d+\.\d+)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.M
    )
    assert released == ours
    assert version.get_forthcoming_label(text) == "Forthcoming"


def test_the_manifest_is_the_only_place_with_a_maintainer():
    maintainer = MANIFEST.find("maintainer")
    assert MANIFEST.findtext("author") == maintainer.text
    address = maintainer.attrib["email"]
    for path in ("setup.py", "setup.cfg", "pyproject.toml", "README.md", "SECURITY.md"):
        assert address not in (ROOT / path).read_text(encoding="utf-8"), path


def test_the_quality_declaration_answers_every_requirement():
    text = (ROOT / "QUALITY_DECLARATION.md").read_text(encoding="utf-8")
    assert "**Quality Level 4**" in text
    for number, sections in {1: 6, 2: 5, 3: 5, 4: 5, 5: 3, 6: 1, 7: 1}.items():
        assert re.search(rf"^## .*\[{number}\]$", text, re.MULTILINE), number
        for roman in ("i", "ii", "iii", "iv", "v", "vi")[:sections]:
            assert re.search(rf"^### .*\[{number}\.{roman}\]$", text, re.MULTILINE), (
                f"{number}.{roman}"
            )
    assert "(QUALITY_DECLARATION.md)" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_xmllint_accepts_every_xml_file():
    """With ament_xmllint, which validates against the schema on the network, or xmllint alone."""
    if not shutil.which("xmllint"):
        pytest.skip("xmllint is not installed (package libxml2-utils)")
    files = [str(ROOT / "package.xml"), *map(str, (ROOT / "launch").glob("*.xml"))]
    command = ["xmllint", "--noout", *files]
    if importlib.util.find_spec("ament_xmllint"):
        command = [sys.executable, "-m", "ament_xmllint.main", *files]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "failed to load" in done.stderr and "http" in done.stderr:
        pytest.skip("the schema of package.xml is on the network, which there is none of")
    assert done.returncode == 0, done.stderr
