# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The losses of a batch and the schedule by which training blends them (Algorithm 1)."""
