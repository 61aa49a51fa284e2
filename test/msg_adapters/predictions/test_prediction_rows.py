# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions as a pandas data frame."""

import dataclasses
import sys

import numpy as np
import pytest

from msg_adapters.predictions import prediction_frame, prediction_from_pointcloud2
from msg_adapters.predictions.prediction_cloud import prediction_to_pointcloud2
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.identity import keys_from_texts

pandas = pytest.importorskip("pandas")


def test_one_row_for_each_agent_mode_and_step(prediction):
    table = prediction_frame(prediction)
    assert len(table) == 3 * 4 * 5
    a, m, h = 2, 1, 3
    row = table.iloc[(a * 4 + m) * 5 + h]
    assert (row["mode"], row["step"], row["class"], row["source"]) == (1, 3, "truck", "model")
    assert (row["calibration"], row["frame_id"], row["stamp_ns"]) == (
        "shipped",
        "map",
        prediction.stamp_ns,
    )
    numbers = [*prediction.mean[a, m, h], prediction.yaw[a, m, h], prediction.weight[a, m]]
    assert row[["x", "y", "vx", "vy", "yaw", "weight"]].tolist() == pytest.approx(numbers)
    assert row["t"] == pytest.approx(0.8)
    assert row[["z", "length", "width"]].tolist() == [2.0, 12.0, 2.5]
    assert row[["cov_xx", "cov_xy", "cov_yy"]].tolist() == pytest.approx(
        prediction.covariance[a, m, h].reshape(4)[[0, 1, 3]].tolist()
    )
    assert row["sigma_factor_50"] == pytest.approx(prediction.sigma_factor_50[a, h])


def test_the_identity_in_the_table_leads_back_to_the_key(prediction):
    key = prediction.key.copy()
    key[0] = [17, 0, 0, 0]
    table = prediction_frame(dataclasses.replace(prediction, key=key))
    texts = table["agent"].iloc[::20].tolist()
    assert texts[0] == "17"
    np.testing.assert_array_equal(keys_from_texts(texts), key)


def test_several_predictions_are_one_table(prediction, offline):
    later = dataclasses.replace(prediction, stamp_ns=prediction.stamp_ns + 200_000_000)
    clouds = [prediction_to_pointcloud2(one, offline) for one in (prediction, later)]
    table = prediction_frame(prediction_from_pointcloud2(cloud) for cloud in clouds)
    assert table.groupby("stamp_ns").size().tolist() == [60, 60]
    weights = table[table["step"] == 0].groupby(["stamp_ns", "agent"], observed=True)["weight"]
    np.testing.assert_allclose(weights.sum(), 1.0, rtol=1e-6)


def test_no_prediction_gives_an_empty_table_of_the_same_types(prediction):
    full, empty = prediction_frame(prediction), prediction_frame([])
    assert len(empty) == 0
    assert list(empty.columns) == list(full.columns)
    for name in ("stamp_ns", "mode", "x", "class", "source"):
        assert empty[name].dtype == full[name].dtype, name


def test_a_number_without_a_name_is_missing(prediction):
    table = prediction_frame(
        dataclasses.replace(prediction, source=np.array([0, 200, 2], np.uint8))
    )
    assert table["source"].isna().sum() == 20


def test_without_pandas_one_sentence_says_what_to_install(prediction, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ConfigurationError, match=r"needs pandas, .* expected pip install pandas"):
        prediction_frame(prediction)
