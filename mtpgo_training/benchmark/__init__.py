# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo benchmark``: how fast the exported model is, measured side by side."""

from mtpgo_training.benchmark.command import add_parser

__all__ = ["add_parser"]
