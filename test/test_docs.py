# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Links, file names, make targets and the index of the pages refer to things that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FRONT = [
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md")),
    ROOT / "QUALITY_DECLARATION.md",
    *sorted((ROOT / "resource" / "weights").glob("*.md")),
]
PAGES = [*FRONT, *sorted((ROOT / "docs").glob("*.md"))]


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings."""
    heads = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_have_a_target(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith(("http:", "https:", "mailto:")):
            continue
        name, _, anchor = target.partition("#")
        other = page.parent / name if name else page
        assert other.exists(), f"{page.name} links to {target}"
        if anchor:
            assert anchor in anchors(other), f"{page.name} links to {target}"


FOLDERS = {path.name for path in ROOT.iterdir() if path.is_dir() and path.name[0] != "."}
PATH = re.compile(r"`((?:[\w.-]+/)+[\w.-]*)`")
CURRENT = [page for page in PAGES if page.name != "CHANGELOG.md"]


@pytest.mark.parametrize("page", CURRENT, ids=lambda page: page.name)
def test_files_named_in_the_pages_exist(page):
    """Every path in backticks that starts with a folder of the repository."""
    for path in PATH.findall(page.read_text(encoding="utf-8")):
        if path.split("/")[0] in FOLDERS - {
            "build",
            "demo_output",
            "dist",
            "install",
            "log",
            "runs",
        }:
            assert (ROOT / path).exists(), f"{page.name} names {path}"


def test_a_file_name_in_a_page_is_recognised():
    text = "See `models/ekf.py`, `docs/`, `lib/mtpgo_ros/` and `a / b`."
    assert PATH.findall(text) == ["models/ekf.py", "docs/", "lib/mtpgo_ros/"]


def test_the_index_lists_every_page():
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    for page in (ROOT / "docs").glob("*.md"):
        assert page.name == "index.md" or f"({page.name})" in index, page.name


def test_a_version_in_the_changelog_has_each_kind_of_change_once():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    for version in text.split("\n## ")[1:]:
        kinds = re.findall(r"^### (.+)$", version, re.MULTILINE)
        assert len(kinds) == len(set(kinds)), kinds


def test_make_targets_in_the_pages_exist():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):", makefile, re.MULTILINE))
    for page in PAGES:
        blocks = re.findall(r"```\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
        for target in re.findall(r"\bmake ([a-z]+)", "\n".join(blocks)):
            assert target in targets, f"{page.name} names make {target}"
