# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A usable folder for the log files of ROS, without which rclpy does not start."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from mtpgo_ros.runtime.executable import tell

_WITHOUT_FILES = ["--ros-args", "--disable-external-lib-logs"]
"""Arguments with which ROS writes no log files."""


def choose_log_folder(program: str) -> list[str]:
    """Let ROS write its logs into another folder if its own is not usable, and say so on stderr.

    ROS takes ``ROS_LOG_DIR``, else ``ROS_HOME``/log, else ``HOME``/.ros/log. A service without a
    home, a read-only file system or a folder of another user would otherwise end the process.

    Args:
        program: name of the program, for the sentence.

    Returns:
        Arguments to be added to those of ROS.
    """
    try:
        wanted = _wanted()
    except RuntimeError as error:  # A ~ that stands for no home.
        wanted, reason = None, str(error).removesuffix(".")
    else:
        reason = "HOME is not set" if wanted is None else f"{wanted} is not writable"
    if wanted is not None and _is_usable(wanted):
        return []
    instead = Path(tempfile.gettempdir()) / f"mtpgo_ros-{os.getuid()}" / "log"
    if _is_usable(instead):
        os.environ["ROS_LOG_DIR"] = str(instead)
        _say(program, f"{reason}: log files go to {instead} (ROS_LOG_DIR sets another folder)")
        return []
    _say(program, f"{reason}, nor is {instead}: no log files are written")
    return list(_WITHOUT_FILES)


def _wanted() -> Path | None:
    """Return the folder that ROS would take, None if there is no way to find one.

    Raises:
        RuntimeError: its ``~`` stands for a user who is not known, or has no home.
    """
    given = os.environ.get("ROS_LOG_DIR")
    if given:
        return Path(given).expanduser()
    home = os.environ.get("ROS_HOME")
    if home:
        return Path(home).expanduser() / "log"
    home = os.environ.get("HOME")
    return Path(home) / ".ros" / "log" if home else None


def _is_usable(folder: Path) -> bool:
    """Return whether files can be made in a folder, which is made if it is not there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _say(program: str, sentence: str) -> None:
    tell(f"{program}: {sentence}", error=True)
