# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Ring buffers of the last samples of many tracks, all of one length, which grows on demand."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.history.resampling import NEVER_NS
from mtpgo_core.schema import Float64Array, IndexArray

_HIGHEST_RATE_HZ = 200.0
"""Chosen: several times the rate of any known tracker."""
_SHORTEST = 64
"""Samples in a new ring: 3 s at 20 Hz."""


def longer(array: NDArray[Any], capacity: int, fill: float = 0) -> NDArray[Any]:
    """Return an array [n, ...] as [capacity, ...], with ``fill`` in the new rows."""
    more = np.full((capacity - len(array), *array.shape[1:]), fill, dtype=array.dtype)
    return np.concatenate([array, more])


class SampleRings:
    """One ring of samples per slot.

    The rings are as long as the fastest track needs to keep its samples for ``keep_ns``. Samples
    that arrive faster than 200 Hz replace each other: the newest is always kept, the memory is
    bounded, and the samples of a real tracker are never thinned.

    Args:
        capacity: number of slots.
        columns: values per sample.
        keep_ns: how long a sample is kept (ns).

    Attributes:
        last_ns: [capacity] stamp of the newest sample, ``NEVER_NS`` where there is none.
        last: [capacity, columns] the newest sample, NaN where there is none.
        count: [capacity] samples written.
    """

    def __init__(self, capacity: int, columns: int, keep_ns: int) -> None:
        self._keep_ns = keep_ns
        self._spacing_ns = round(1e9 / _HIGHEST_RATE_HZ)
        self._longest = keep_ns // self._spacing_ns + 3
        length = min(_SHORTEST, self._longest)
        self._stamp = np.full((capacity, length), NEVER_NS, dtype=np.int64)
        self._sample = np.full((capacity, length, columns), np.nan)
        self.count = np.zeros(capacity, dtype=np.int64)
        self.last_ns = np.full(capacity, NEVER_NS, dtype=np.int64)
        self.last = np.full((capacity, columns), np.nan)

    @property
    def capacity(self) -> int:
        """Number of slots."""
        return self._stamp.shape[0]

    def grow(self, capacity: int) -> None:
        """Make room for ``capacity`` slots, keeping the existing samples."""
        self._stamp = longer(self._stamp, capacity, NEVER_NS)
        self._sample = longer(self._sample, capacity, np.nan)
        self.count = longer(self.count, capacity)
        self.last_ns = longer(self.last_ns, capacity, NEVER_NS)
        self.last = longer(self.last, capacity, np.nan)

    def clear(self, slot: IndexArray) -> None:
        """Empty the slots."""
        self._stamp[slot] = NEVER_NS
        self.count[slot] = 0
        self.last_ns[slot] = NEVER_NS
        self.last[slot] = np.nan

    def append(
        self, slot: IndexArray, stamp_ns: int | NDArray[np.int64], sample: Float64Array
    ) -> None:
        """Append one sample to each slot, newer than all samples of that slot.

        Args:
            slot: [n] which slots, each at most once.
            stamp_ns: time of the samples, one for all or [n] (ns).
            sample: [n, columns].
        """
        column = self._columns(slot, stamp_ns)
        self._stamp[slot, column] = stamp_ns
        self._sample[slot, column] = sample
        self.last_ns[slot] = stamp_ns
        self.last[slot] = sample

    def in_order(self, slot: IndexArray) -> tuple[NDArray[np.int64], IndexArray]:
        """Return ascending stamps [n, K], first ``NEVER_NS``, and indices for :meth:`samples`."""
        length = self._stamp.shape[1]
        place = (self.count[slot][:, None] + np.arange(length)) % length
        written = np.arange(length) >= length - self.count[slot][:, None]
        return np.where(written, self._stamp[slot[:, None], place], NEVER_NS), place

    def samples(self, slot: IndexArray, place: IndexArray) -> Float64Array:
        """Return the samples [n, T, columns] of each slot at the ring indices ``place`` [n, T]."""
        return self._sample[slot[:, None], place]

    def _columns(self, slot: IndexArray, stamp_ns: int | NDArray[np.int64]) -> IndexArray:
        """Return [n] ring indices for new samples; lengthen the rings if they are too short."""
        while True:
            length = self._stamp.shape[1]
            count = self.count[slot]
            column = count % length
            before_ns = self._stamp[slot, (count - 2) % length]
            crowded = (count >= 2) & (self.last_ns[slot] - before_ns < self._spacing_ns)
            lost = ~crowded & (self._stamp[slot, column] >= stamp_ns - self._keep_ns)
            if not lost.any() or length >= self._longest:
                break
            self._lengthen(min(2 * length, self._longest))
        self.count[slot] += ~crowded
        return np.where(crowded, (count - 1) % length, column)

    def _lengthen(self, length: int) -> None:
        """Lengthen the rings; the oldest sample becomes the first."""
        capacity, old, columns = self._sample.shape
        rows = np.arange(capacity)[:, None]
        place = (np.maximum(self.count, old)[:, None] + np.arange(old)) % old
        stamp = np.full((capacity, length), NEVER_NS, dtype=np.int64)
        sample = np.full((capacity, length, columns), np.nan)
        stamp[:, :old], sample[:, :old] = self._stamp[rows, place], self._sample[rows, place]
        self.count = np.minimum(self.count, old)
        self._stamp, self._sample = stamp, sample
