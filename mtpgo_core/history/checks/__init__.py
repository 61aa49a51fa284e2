# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether what is observed can be: shared identities, velocities of another frame or unit."""
