# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The executables of ``mtpgo_ros`` as child processes."""
