# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The memory of the process: what glibc and Linux do with it. No ROS here."""

from __future__ import annotations

import ctypes
from pathlib import Path

# From glibc's malloc.h.
_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -2, -3, -8

# From linux/prctl.h and linux/mman.h.
_PR_SET_THP_DISABLE = 41
_MADV_POPULATE_WRITE = 23

_tuned = False
"""Whether :func:`tune_allocator` made its settings in this process."""

_resident_end = 0
"""Where the heap ended when all of it was resident, 0 if it is not."""


def tune_allocator() -> bool:
    """Make glibc keep the memory that a prediction frees for the next one.

    By default glibc returns blocks above a threshold to the system immediately and requests them
    again, page by page, in the next cycle: with many agents that takes longer than the model. The
    disadvantage is that the process keeps its peak memory.

    Returns:
        Whether the settings were made; false if the C library is not glibc.
    """
    libc = ctypes.CDLL(None)
    if not hasattr(libc, "gnu_get_libc_version"):
        return False
    # Bytes; chosen: blocks up to 32 MB (glibc's maximum) come from the heap, of which 1 GB may be
    # free before it is trimmed, and which grows in steps of 64 MB. One heap for all threads: what
    # one of them frees serves the others, 40 MB less with 64 road users (measured).
    settings = (
        (_M_ARENA_MAX, 1),
        (_M_MMAP_THRESHOLD, 1 << 25),
        (_M_TRIM_THRESHOLD, 1 << 30),
        (_M_TOP_PAD, 64 << 20),
    )
    global _tuned
    _tuned = all(libc.mallopt(name, value) == 1 for name, value in settings)
    return _tuned


def use_small_pages() -> bool:
    """Let Linux give this process no huge pages; call it before memory is used.

    numpy asks for them where an array has 4 MB or more, and with the settings of
    :func:`tune_allocator` these arrays are on the heap, as is all that comes to their place after
    them. Minutes later the kernel replaces 512 pages of 4 kB there by one of 2 MB, also where most
    of them have never been used, so that the resident memory grows in steps that no code explains.

    Returns:
        Whether the setting was made; false if the system has none.
    """
    libc = ctypes.CDLL(None)
    return hasattr(libc, "prctl") and libc.prctl(_PR_SET_THP_DISABLE, 1, 0, 0, 0) == 0


def return_free_memory() -> None:
    """Return freed memory to the system; call it once after a memory-intensive step.

    Reading a TorchScript file frees some 80 MB (measured) that the process would otherwise keep.
    """
    global _resident_end
    _resident_end = 0
    libc = ctypes.CDLL(None)
    if hasattr(libc, "malloc_trim"):  # glibc's
        libc.malloc_trim(0)


def keep_heap_resident() -> bool:
    """Let all pages of the heap be in memory; no effect unless the allocator is tuned.

    Of the heap that :func:`tune_allocator` keeps, some 40 MB have not been used minutes after the
    start (measured). A late prediction, or blocks in another order, use them hours later: the
    resident memory then grows in steps without a leak, and each new page costs time within a
    prediction.

    Call it again and again while there are predictions: it takes microseconds where the heap has
    not grown since, and memory was not returned; 64 MB take 30 ms (measured).

    Returns:
        Whether something was to be done and was; false without Linux 5.14 or newer.
    """
    global _resident_end
    if not _tuned:
        return False
    libc = ctypes.CDLL(None)
    libc.sbrk.restype = ctypes.c_void_p
    libc.madvise.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
    heap_end = libc.sbrk(0)
    if heap_end == _resident_end:
        return False
    _resident_end = heap_end
    done = True
    for line in Path("/proc/self/maps").read_text(encoding="utf-8").splitlines():
        # One for each part for which something was asked, as numpy does for large arrays.
        if line.endswith("[heap]"):
            first, end = (int(address, 16) for address in line.split(maxsplit=1)[0].split("-"))
            done &= libc.madvise(first, end - first, _MADV_POPULATE_WRITE) == 0
    return done
