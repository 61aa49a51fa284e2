# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Each kind of message with predictions is read as it is written."""

import numpy as np
import pytest

from msg_adapters.predictions.prediction_messages import PREDICTIONS
from msg_adapters.registry import OUTPUTS


@pytest.mark.parametrize("name", PREDICTIONS)
def test_every_kind_is_read_from_what_the_output_of_that_name_writes(
    name, prediction, offline, typestore
):
    adapter = PREDICTIONS[name]
    message = OUTPUTS[name].writer(offline)(prediction)
    data = bytes(typestore.serialize_cdr(message, adapter.message_type))
    assert adapter.message_type == OUTPUTS[name].message_type
    for assumes in (False, True):
        found = adapter.read(data, assumes)
        np.testing.assert_array_equal(found.key, prediction.key)
        np.testing.assert_allclose(found.mean[..., :2], prediction.mean[..., :2], atol=1e-5)
        assert np.isfinite(found.covariance).all() == (assumes or name == "pointcloud2")
