# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Settings of the process that make training faster and change no result that matters."""

from __future__ import annotations

import ctypes

import torch

_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_THRESHOLD = -1, -2, -3
_KEEP_BYTES = 1 << 30
_LARGEST_MMAP_THRESHOLD = 32 << 20  # glibc refuses more


def prepare_process(num_threads: int) -> None:
    """Set torch's threads and let freed memory stay with the process.

    glibc gives large blocks back to the system as soon as they are freed and must have them zeroed
    again for the next step; large batches are faster when it keeps them. Denormal numbers, many
    times slower than others, count as zero.

    Args:
        num_threads: threads of torch; 0 leaves torch's own choice. On a machine with other work
            fewer can be faster, for OpenMP's threads wait for each other in every operation.
    """
    if num_threads > 0:
        torch.set_num_threads(num_threads)
    torch.set_flush_denormal(True)
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):
        return  # another C library, which has habits of its own
    for option, value in (
        (_M_MMAP_THRESHOLD, _LARGEST_MMAP_THRESHOLD),
        (_M_TRIM_THRESHOLD, _KEEP_BYTES),
        (_M_TOP_PAD, _KEEP_BYTES >> 4),
    ):
        mallopt(option, value)
