# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest
from demo_traffic import perfect_prediction

from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.predictions import prediction_to_pointcloud2
from mtpgo_core.errors import RecordingError
from mtpgo_training.demo.recorded_messages import read_messages


def test_a_recorded_bag_is_read(recording, tmp_path):
    prediction = perfect_prediction(recording, 10)
    with McapWriter(tmp_path / "bag") as bag:
        cloud = prediction_to_pointcloud2(prediction, bag.types)
        make = bag.types.make
        for topic, kind, received_ns, message in (
            ("/objects", "sensor_msgs/msg/PointCloud2", 11, cloud),
            ("/predictor/predictions", "sensor_msgs/msg/PointCloud2", 22, cloud),
            (
                "/predictor/debug/processing_time_ms",
                "std_msgs/msg/Float64",
                23,
                make("std_msgs/msg/Float64", data=7.5),
            ),
            ("/other", "std_msgs/msg/Float64", 24, make("std_msgs/msg/Float64", data=1.0)),
        ):
            bag.add_topic(topic, kind)
            bag.write(topic, received_ns, message)
        status = [
            make(
                "diagnostic_msgs/msg/DiagnosticStatus",
                name="predictor: timing",
                values=[make("diagnostic_msgs/msg/KeyValue", key="deadline_misses", value=value)],
            )
            for value in ("0", "2")
        ]
        bag.add_topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
        for entry in status:
            array = make("diagnostic_msgs/msg/DiagnosticArray", status=[entry])
            bag.write("/diagnostics", 25, array)
    recorded = read_messages(tmp_path / "bag")
    assert recorded.observed == {prediction.stamp_ns: 11}
    (received,) = recorded.predictions
    assert received.received_ns == 22
    np.testing.assert_allclose(received.prediction.mean, prediction.mean, rtol=1e-6, atol=1e-6)
    assert recorded.processing_ms == [7.5]
    assert recorded.diagnostics == {"predictor: timing": {"deadline_misses": "2"}}


def test_a_missing_bag_is_reported(tmp_path):
    with pytest.raises(RecordingError, match="does not exist"):
        read_messages(tmp_path / "none")
