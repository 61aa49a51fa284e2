# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the documentation site needs besides docs/*.md: pages made of the code, links, formulas."""
