# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""MTP-GO in torch: no ROS, no files, no numpy; it can be compiled to TorchScript.

The axes in every shape of this package: ``B`` scenes, ``N`` agents of a
scene, ``T`` history steps, ``H`` horizon steps, ``M`` modes, ``S`` states, ``F`` features, ``C``
static features, ``D`` hidden units. Lengths are in metres, times in seconds, angles in radians.
Equation and section numbers are those of the paper (Westny et al., *MTP-GO*, 2023).
"""

from models.mtp_go import MTPGO
from models.mtp_go_config import ModelConfig

__all__ = ["MTPGO", "ModelConfig"]
