# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which predictions are learned from, for how long each counts, and which factors it had."""

import numpy as np
import pytest

from mtpgo_core.live_calibration.served_tables import ServedTables

S_NS = 1_000_000_000


def add(tables, stamp_s, log_sigma=0.0, spacing_s=0.0):
    """Add a table whose only value is ``log_sigma``."""
    values = np.full(1, log_sigma)
    return tables.add(round(stamp_s * S_NS), values, np.zeros(1), spacing_s)


def spans_s(tables):
    """The time for which each kept prediction counts (s)."""
    return [table.span_s for table in tables.find(np.empty(0, dtype=np.int64))[1]]


def test_a_prediction_counts_for_the_time_since_the_last_one_and_at_most_a_second():
    tables = ServedTables()
    taken = [add(tables, stamp_s) for stamp_s in (10.0, 10.2, 10.4, 10.7, 11.2, 15.0)]
    assert taken == pytest.approx([1.0, 0.0, 0.4, 0.0, 0.8, 1.0])
    np.testing.assert_allclose(spans_s(tables), [1.0, 0.4, 0.8, 1.0])


def test_predictions_that_are_kept_more_rarely_count_for_longer():
    tables = ServedTables()
    taken = [add(tables, stamp_s, spacing_s=2.0) for stamp_s in (10.0, 11.9, 12.1, 20.0)]
    assert taken == pytest.approx([4.0, 0.0, 2.1, 4.0])
    np.testing.assert_allclose(spans_s(tables), [4.0, 2.1, 4.0])


def test_tables_are_found_by_the_stamps_of_their_predictions():
    tables = ServedTables()
    for stamp_s in (10.0, 11.0, 12.0):
        add(tables, stamp_s, log_sigma=stamp_s)
    index, found = tables.find(np.array([12, 10, 9, 12]) * S_NS)
    assert index.tolist() == [2, 0, -1, 2]
    assert [table.log_sigma[0] for table in found] == [10.0, 11.0, 12.0]


def test_of_a_clock_that_was_set_back_only_the_new_predictions_are_found():
    tables = ServedTables()
    for stamp_s in (10.0, 11.0, 3.0):
        assert add(tables, stamp_s)
    assert tables.find(np.array([10, 3]) * S_NS)[0].tolist() == [-1, 0]
    assert spans_s(tables) == [1.0]
