# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The report of an evaluation: one page, its figures, and tables in Markdown."""
