# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The thread that loads another model; the service is tested as a fault of the running node."""

import contextlib
import time

import pytest

from mtpgo_core.errors import ModelFileError
from mtpgo_ros.node.model_host import ModelHost
from mtpgo_ros.node.model_swap import _Loading
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters


def test_a_model_that_is_loaded_too_late_is_not_reported_as_swapped(models):
    parameters = PredictorParameters(model=str(models["quick"]))
    host = ModelHost(parameters)
    before = host.predictor
    loading = _Loading(host, parameters, contextlib.nullcontext())
    loading._end_s = time.monotonic()
    loading.start()
    loading.join()  # reading a file keeps the executor waiting: it looks after its end only
    with pytest.raises(ModelFileError, match="was not loaded within 60 s"):
        list(loading.__await__())
    assert host.predictor is before
