# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The picture of ``mtpgo data``: panels with and without values."""

import pytest

from mtpgo_training.reports.recordings import data_picture


def test_a_panel_without_values_says_none():
    figure = pytest.importorskip("matplotlib.figure").Figure()
    empty, full = figure.subplots(2)
    data_picture._bars(empty, "defects", {})
    data_picture._bars(full, "defects", {"gap": 3, "jump": 1}, whole=True)
    assert [text.get_text() for text in empty.texts] == ["none"]
    assert (empty.axison, empty.get_title()) == (False, "defects")
    assert [bar.get_width() for bar in full.patches] == [3, 1]
    assert all(tick == round(tick) for tick in full.get_xticks())
