# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Calibration: samples of a model's errors, the fit of its factors, and what the fit brings."""
