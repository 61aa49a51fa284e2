# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The network's inner functions, each as a plain function and with a hand-written gradient.

Every file has three parts. ``plain_NAME`` is the function as its equation has it; autograd can
differentiate it. The :class:`torch.autograd.Function` computes the same values and gradients;
training runs it for the speed and memory that docs/performance.md reports ("A step of training").
``NAME`` is what the network calls: it chooses the second where autograd runs on one type
throughout, and the first in TorchScript and where autocast mixes types.
"""
