# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Metrics, score tables and the evaluation of models and recorded predictions."""
