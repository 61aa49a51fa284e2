# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files of the package in the source tree and in an installation."""

import pytest

from mtpgo_core import resources
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.resources import find_resource, source_tree


def test_the_source_tree_is_searched_first():
    root = source_tree()
    assert find_resource("weights", "default.pt") == root / "resource/weights/default.pt"
    assert find_resource("config", "predictor.yaml") == root / "config/predictor.yaml"


def test_prefixes_of_ament_are_searched_last(monkeypatch, tmp_path):
    file = tmp_path / "second" / "share" / "mtpgo_ros" / "weights" / "x.pt"
    file.parent.mkdir(parents=True)
    file.touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'first'}:{tmp_path / 'second'}")
    assert find_resource("weights", "x.pt") == file


def test_an_installation_has_no_source_tree(monkeypatch, tmp_path):
    monkeypatch.setattr(resources, "__file__", str(tmp_path / "mtpgo_core" / "resources.py"))
    assert source_tree() is None


def test_a_missing_file_is_reported_with_the_searched_places(monkeypatch, tmp_path):
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    with pytest.raises(ConfigurationError, match=f"weights/x.pt is not among .*{tmp_path}/share"):
        find_resource("weights", "x.pt")
