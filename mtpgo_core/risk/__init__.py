# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The risk that predicted road users collide with the ego's plan; arrays only, no messages."""
