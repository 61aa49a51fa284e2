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
    loading = _Loading(host, parameters, contextlib.nullcontext(), lambda: True)
    loading._end_s = time.monotonic()
    loading.start()
    loading.join()  # reading a file keeps the executor waiting: it looks after its end only
    with pytest.raises(ModelFileError, match="was not loaded within 60 s"):
        list(loading.__await__())
    assert host.predictor is before


@pytest.mark.parametrize("in_use", [True, False])
def test_a_host_that_was_released_meanwhile_writes_no_calibration_file(models, tmp_path, in_use):
    path = tmp_path / "calibration.json"
    parameters = PredictorParameters(model=str(models["quick"]), calibration_file=str(path))
    loading = _Loading(ModelHost(parameters), parameters, contextlib.nullcontext(), lambda: in_use)
    loading.start()
    list(loading.__await__())
    assert path.exists() == in_use
