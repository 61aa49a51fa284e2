# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import shutil

from mtpgo_core.task.model_file import find_model
from mtpgo_training.cli import main


def test_a_shipped_model_shows_its_data_and_its_card(capsys):
    assert main(["info", "default"]) == 0
    text = capsys.readouterr().out
    for part in ("horizon    25 steps", "licence", "attribution", "validation", "ade"):
        assert part in text
    assert "# Model card: `default`" in text


def test_a_model_file_without_a_card_shows_its_description(tmp_path, capsys):
    path = tmp_path / "mine.pt"
    shutil.copy(find_model("default"), path)
    assert main(["info", str(path)]) == 0
    text = capsys.readouterr().out
    assert "weights    sha256" in text
    assert "Model card" not in text


def test_an_unknown_model_gives_a_one_line_error(capsys):
    assert main(["info", "nobody"]) == 2
    assert "expected a path or one of default" in capsys.readouterr().err
