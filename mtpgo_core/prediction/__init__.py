# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Running the model: from scenes to predictions in the fixed frame, with fallback."""
