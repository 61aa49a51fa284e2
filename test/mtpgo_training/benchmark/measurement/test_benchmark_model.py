# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The model files that are measured."""

import pytest

from mtpgo_core.errors import ModelFileError
from mtpgo_core.task.model_file import find_model, load_task
from mtpgo_training.benchmark.measurement.benchmark_model import REFERENCE, model_file


def test_the_reference_is_exported_and_deleted_afterwards():
    with model_file(REFERENCE) as path:
        assert load_task(path).name == REFERENCE
    assert not path.parent.exists()


def test_other_models_are_found_by_name_or_path(tmp_path):
    with model_file("default") as path:
        assert path == find_model("default").resolve()
    assert path.is_file()
    (tmp_path / "text.pt").write_text("no model")
    with pytest.raises(ModelFileError, match=r"text\.pt"), model_file(str(tmp_path / "text.pt")):
        pass
