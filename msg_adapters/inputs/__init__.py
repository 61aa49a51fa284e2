# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of tracked objects, ego poses and lane markings as arrays."""
