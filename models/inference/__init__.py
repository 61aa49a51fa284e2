# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The form in which MTP-GO is exported: the same mathematics in few, long operations.

On small graphs a prediction is thousands of operators of a microsecond each, on large ones a few
passes over [N, N, 3D] numbers. This package therefore multiplies constant matrices in advance (in
float64), and computes the rest with as few operators and passes as possible.
:class:`models.mtp_go.MTPGO` is what trains and what this is tested against.
"""

from models.inference.inference_model import FastMTPGO, deployable

__all__ = ["FastMTPGO", "deployable"]
