# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A training scene together with what is observed of its road users a moment later."""
