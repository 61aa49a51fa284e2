# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Calibration that goes on while predictions are served: how far they can be trusted here."""
