# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane lines of the running node: from a file or a topic, in the frame of the observations."""
