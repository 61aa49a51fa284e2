# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Many independent items through one function: in this process, in several, or on a cluster."""
