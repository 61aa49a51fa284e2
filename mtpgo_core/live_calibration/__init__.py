# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Online calibration: corrects covariances and paths by the outcomes of earlier predictions."""
