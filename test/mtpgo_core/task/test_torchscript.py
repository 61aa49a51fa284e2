# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Only the warnings of torch.jit are silenced, and only within the block."""

import warnings

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.task.model_file import find_model
from mtpgo_core.task.torchscript import torchscript

LOAD = "`torch.jit.load` is deprecated. Please switch to `torch.export`."
OTHER = "`torch.compile` is deprecated"
PYTHON = "`torch.jit.load` is not supported in Python 3.14+ and may break."


def test_what_is_not_about_torch_jit_is_shown():
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        with torchscript():
            for text in (LOAD, OTHER, PYTHON):
                warnings.warn(text, DeprecationWarning, stacklevel=1)
        warnings.warn(LOAD, DeprecationWarning, stacklevel=1)
    assert [str(one.message) for one in seen] == [OTHER, PYTHON, LOAD]


def test_the_shipped_model_loads_without_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ModelRunner.load(find_model("default"))
