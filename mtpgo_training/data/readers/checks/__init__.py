# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What is said about files besides their recordings: remarks, other units, other layouts."""
