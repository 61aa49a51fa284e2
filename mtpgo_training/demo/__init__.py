# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo demo``: the whole chain on recordings, with the real node as its own process."""

from mtpgo_training.demo.command import add_parser

__all__ = ["add_parser"]
