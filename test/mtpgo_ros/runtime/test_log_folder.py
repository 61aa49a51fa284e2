# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The choice of a folder for log files."""

import os
import tempfile

import pytest

from mtpgo_ros.runtime.log_folder import choose_log_folder


@pytest.fixture(autouse=True)
def _no_environment(monkeypatch, tmp_path):
    for name in ("ROS_LOG_DIR", "ROS_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()


@pytest.mark.parametrize(
    ("name", "folder"), [("ROS_LOG_DIR", ""), ("ROS_HOME", "log"), ("HOME", ".ros/log")]
)
def test_the_folder_of_ros_is_kept_where_it_is_usable(monkeypatch, tmp_path, capsys, name, folder):
    monkeypatch.setenv(name, str(tmp_path / "mine"))
    assert choose_log_folder("predictor") == []
    assert (tmp_path / "mine" / folder).is_dir()
    assert capsys.readouterr().err == ""
    assert name == "ROS_LOG_DIR" or "ROS_LOG_DIR" not in os.environ


@pytest.mark.parametrize("given", [None, "/proc/none"])
def test_another_folder_is_chosen_and_reported(monkeypatch, tmp_path, capsys, given):
    monkeypatch.setenv("ROS_LOG_DIR", "")  # restored after the test
    if given:
        monkeypatch.setenv("ROS_LOG_DIR", given)
    assert choose_log_folder("predictor") == []
    assert os.environ["ROS_LOG_DIR"].startswith(str(tmp_path / "temporary"))
    said = capsys.readouterr().err
    assert said.startswith("predictor: ")
    assert os.environ["ROS_LOG_DIR"] in said
    assert (given or "HOME is not set") in said


@pytest.mark.parametrize("name", ["ROS_LOG_DIR", "ROS_HOME"])
def test_the_home_of_an_unknown_user_is_replaced(monkeypatch, tmp_path, capsys, name):
    monkeypatch.setenv("ROS_LOG_DIR", "")  # restored after the test
    monkeypatch.setenv(name, "~nobody_of_this_name/log")
    assert choose_log_folder("predictor") == []
    assert os.environ["ROS_LOG_DIR"].startswith(str(tmp_path / "temporary"))
    assert "Could not determine home directory: log files go to" in capsys.readouterr().err


def test_without_any_folder_no_files_are_written(monkeypatch, capsys):
    monkeypatch.setattr(tempfile, "tempdir", "/proc")
    assert choose_log_folder("predictor") == ["--ros-args", "--disable-external-lib-logs"]
    assert "no log files are written" in capsys.readouterr().err
