# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The paper's four studies: rows, runs, tables beside the paper's figures."""
