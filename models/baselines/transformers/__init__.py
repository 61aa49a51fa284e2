# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""mmTransformer: stacked transformers with fixed proposals (Liu et al., CVPR 2021)."""
