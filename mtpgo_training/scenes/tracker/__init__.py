# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A simulated tracker: recordings as a user's tracker would report them."""
