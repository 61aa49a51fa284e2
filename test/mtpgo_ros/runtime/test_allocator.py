# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Settings of the allocator, each in a process of its own, which keeps them."""

import platform
import subprocess
import sys

import pytest

linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="settings of Linux")


def printed(program: str) -> str:
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_allocator_is_tuned_if_it_is_glibcs():
    tuned = printed("from mtpgo_ros.runtime.allocator import *; print(tune_allocator())")
    assert tuned == f"{platform.libc_ver()[0] == 'glibc'}\n"


@linux
def test_the_process_gets_no_huge_pages():
    program = (
        "from mtpgo_ros.runtime.allocator import use_small_pages; "
        "set_here = use_small_pages(); "
        "print(set_here, [x for x in open('/proc/self/status') if x.startswith('THP_enabled')])"
    )
    assert printed(program) == "True ['THP_enabled:\\t0\\n']\n"


HEAP = """
import re
import numpy as np
from mtpgo_ros.runtime.allocator import keep_heap_resident, return_free_memory, tune_allocator

def missing():
    parts = open('/proc/self/smaps').read().split('[heap]')[1:]
    sizes = [re.search(r'Size: +([0-9]+) kB', part)[1] for part in parts]
    resident = [re.search(r'Rss: +([0-9]+) kB', part)[1] for part in parts]
    return sum(map(int, sizes)) - sum(map(int, resident))

print(keep_heap_resident())
tune_allocator()
kept = [bytearray(1 << 20)]  # the heap grows, by more than that
split = np.empty(8 << 20, 'u1')  # numpy asks Linux for huge pages: the heap is in several parts
before = missing()
print(before > 32 * 1024, keep_heap_resident(), missing(), keep_heap_resident())
more = [bytearray(1 << 20) for _ in range(80)]  # it grows again
before = missing()
print(before > 32 * 1024, keep_heap_resident(), missing())
del more
return_free_memory()
again = [bytearray(1 << 20) for _ in range(80)]
print(keep_heap_resident(), missing())
"""


@linux
@pytest.mark.skipif(
    [int(n) for n in platform.release().split("-")[0].split(".")[:2]] < [5, 14],
    reason="Linux makes pages resident on request since 5.14",
)
def test_all_pages_of_the_heap_are_in_memory_once_it_is_tuned():
    """The node's memory then does not grow when a late prediction needs more of the heap."""
    assert printed(HEAP) == "False\nTrue True 0 False\nTrue True 0\nTrue 0\n"
