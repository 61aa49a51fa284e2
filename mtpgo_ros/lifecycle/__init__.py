# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The lifecycle of the nodes: executables, transitions, bond and resources."""
