# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command ``mtpgo layouts``."""

from mtpgo_training.commands.layouts.layouts_command import add_parser

__all__ = ["add_parser"]
