# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The parts that replace neural ODE and EKF in the paper's ablations."""
