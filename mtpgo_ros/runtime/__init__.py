# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What all executables share: start, stop, arguments and memory settings."""
