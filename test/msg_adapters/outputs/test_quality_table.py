# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rows of scores as a message and back."""

import numpy as np
import pytest

from msg_adapters.outputs.quality_table import quality_from_array, quality_to_array
from mtpgo_core.errors import MessageError
from mtpgo_core.quality.quality_report import QUALITY_ROW


def some_rows():
    rows = np.zeros(3, dtype=QUALITY_ROW)
    rows["stamp_s"] = 1_700_000_000.123456
    rows["window_s"], rows["group"], rows["agents"] = 60, [0, 1, 7], [5, 0, 12]
    rows["ade"], rows["nll"] = [0.5, np.nan, 1.25], -3.0
    return rows


def test_rows_come_back(offline):
    message = quality_to_array(some_rows(), offline)
    found = quality_from_array(message)
    for name in QUALITY_ROW.names:
        np.testing.assert_array_equal(found[name], some_rows()[name])
    assert [d.size for d in message.layout.dim] == [3, len(QUALITY_ROW.names)]
    assert message.layout.dim[0].stride == len(message.data)


def test_columns_are_found_by_name(offline):
    message = quality_to_array(some_rows(), offline)
    names = message.layout.dim[1].label.split(",")
    message.layout.dim[1].label = ",".join("other" if n == "ade" else n for n in names)
    found = quality_from_array(message)
    assert np.isnan(found["ade"]).all()
    assert found["agents"].tolist() == [5, 0, 12]


@pytest.mark.parametrize("label", ["", "a,b", "stamp_s,stamp_s"])
def test_another_array_is_an_error(offline, label):
    message = quality_to_array(some_rows(), offline)
    message.layout.dim[1].label = label
    message.data = message.data[:-1]
    with pytest.raises(MessageError, match="array of 41 numbers has the dimensions"):
        quality_from_array(message)
