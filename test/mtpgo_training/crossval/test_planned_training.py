# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The folder of several trainings: new, or one to continue, also when others begin just now."""

import json

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.crossval.planned_training import keep_facts, require_folder_of


@pytest.mark.parametrize("place", ["none", "empty"])
def test_a_new_folder_gets_what_determines_the_results(tmp_path, place):
    facts = tmp_path / place / "study.json"
    (tmp_path / "empty").mkdir()
    keep_facts(facts, {"study": "layers", "rows": [1]}, "study", ("rows",))
    assert json.loads(facts.read_text())["study"] == "layers"
    keep_facts(facts, {"study": "layers", "rows": [1]}, "study", ("rows",))
    with pytest.raises(ConfigurationError, match="study is static, but layers in"):
        keep_facts(facts, {"study": "static", "rows": [1]}, "study", ("rows",))
    with pytest.raises(ConfigurationError, match="the rows differ from those in"):
        keep_facts(facts, {"study": "layers", "rows": [2]}, "study", ("rows",))


def test_something_else_is_left_alone(tmp_path):
    (tmp_path / "notes.txt").write_text("")
    for path in (tmp_path, tmp_path / "notes.txt"):
        with pytest.raises(ConfigurationError, match="which holds no study, expected a new"):
            require_folder_of(path / "study.json", "study")


def test_what_another_process_is_about_to_write_is_nothing_else(tmp_path):
    """Tasks of a job array begin at the same time, with the same folder."""
    (tmp_path / ".study.json.k3j4").write_text('{"stu')
    require_folder_of(tmp_path / "study.json", "study")
    keep_facts(tmp_path / "study.json", {"study": "layers"}, "study", ())
