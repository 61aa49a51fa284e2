# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Pairs of training scenes: the same road users in one window and in the next."""
