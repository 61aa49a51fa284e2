# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""NGSIM trajectories in the forms in which they are passed on."""
