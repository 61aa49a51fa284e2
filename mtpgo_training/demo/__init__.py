# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo demo``: the whole chain on one recording, with the real node as its own process."""
