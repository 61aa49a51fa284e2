# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Shared by all executables: start, stop, arguments and memory settings."""
