# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Offline only: readers, bags, dataset, training, metrics, evaluation, export."""
