# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""CITATION.cff has what citation tools need, and says what the other files say."""

import re
from xml.etree import ElementTree

import yaml
from page_blocks import ROOT

CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
PAPER = CITATION["preferred-citation"]


def test_the_fields_that_the_format_requires_are_there():
    assert CITATION["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= CITATION.keys()
    assert {"type", "title", "authors"} <= PAPER.keys()
    assert all({"family-names", "given-names"} <= author.keys() for author in PAPER["authors"])


def test_version_and_licence_are_those_of_the_package():
    package = ElementTree.parse(ROOT / "package.xml").getroot()
    assert CITATION["version"] == package.findtext("version")
    assert CITATION["license"] == package.findtext("license")
    assert CITATION["authors"] == [{"name": package.findtext("maintainer")}]


def test_the_paper_is_the_one_that_the_pages_name():
    for name in ("README.md", "docs/theory.md"):
        text = re.sub(r"\s+", " ", (ROOT / name).read_text(encoding="utf-8"))
        assert PAPER["title"] in text
        assert f"{PAPER['journal']} {PAPER['volume']}({PAPER['issue']})" in text.replace("*", "")
        for author in PAPER["authors"]:
            assert author["family-names"] in text
    theory = (ROOT / "docs" / "theory.md").read_text(encoding="utf-8")
    assert f"{PAPER['start']}-{PAPER['end']}" in theory
    assert PAPER["doi"] in theory
