# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Silences torch's deprecation warnings where TorchScript is used on purpose."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def torchscript() -> Iterator[None]:
    """Silence, within the block, what torch warns of its own functions in ``torch.jit``.

    Since 2.13 each of them warns that it is deprecated. Model files stay TorchScript for the
    present: the node runs them without the code of the network, and checks their graph before it
    does (docs/design.md, Model files are programs). Other deprecations are shown as usual.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"`torch\.jit\.\w+` is deprecated", DeprecationWarning)
        yield
