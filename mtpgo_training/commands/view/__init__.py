# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command ``mtpgo view``."""

from mtpgo_training.commands.view.view_command import add_parser

__all__ = ["add_parser"]
