# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Trajectron++: a discrete latent, recurrent encoders, dynamics (Salzmann et al., 2020)."""
