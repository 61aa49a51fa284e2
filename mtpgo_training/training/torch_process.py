# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Process-wide settings of threads, denormal numbers and memory that make training faster."""

from __future__ import annotations

import ctypes

import torch

_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_THRESHOLD = -1, -2, -3
_KEEP_BYTES = 1 << 30  # more than a training step uses (chosen)
_LARGEST_MMAP_THRESHOLD = 32 << 20  # the maximum in glibc


def prepare_process(num_threads: int) -> None:
    """Set torch's threads, flush denormal numbers to zero, and keep freed memory in the process.

    glibc returns large blocks to the system as soon as they are freed and gets them back zeroed
    for the next step; large batches are faster if it keeps them. Denormal numbers are many times
    slower than others.

    Args:
        num_threads: threads of torch; 0 is torch's default. On a machine with other work fewer
            can be faster, because OpenMP's threads wait for each other in every operation.
    """
    if num_threads > 0:
        torch.set_num_threads(num_threads)
    torch.set_flush_denormal(True)
    # In mixed precision, gradients of a weight with a cached cast are summed in half precision.
    torch.set_autocast_cache_enabled(False)
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):
        return  # not glibc
    for option, value in (
        (_M_MMAP_THRESHOLD, _LARGEST_MMAP_THRESHOLD),
        (_M_TRIM_THRESHOLD, _KEEP_BYTES),
        (_M_TOP_PAD, _KEEP_BYTES >> 4),
    ):
        mallopt(option, value)
