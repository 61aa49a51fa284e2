# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The files of a run of a study: what of them is there, and what is damaged."""

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.study.study_run import RunFiles, missing_text


def test_a_run_is_waiting_failed_or_done(tmp_path):
    files = RunFiles(tmp_path)
    assert missing_text({3: files}) == "not run yet: seed 3"
    files.write_error(ConfigurationError("too little"))
    assert missing_text({3: files}) == "seed 3 failed: too little"
    files.scores.write_text('{"seed": 3, "training": {}, "values": {}}')
    assert missing_text({3: files}) is None
    assert files.result() == {"seed": 3, "training": {}, "values": {}}


@pytest.mark.parametrize("text", ["", "null", "[1]", "{}"])
def test_damaged_scores_are_named(tmp_path, text):
    files = RunFiles(tmp_path)
    files.scores.write_text(text)
    with pytest.raises(ConfigurationError, match=r"scores\.json is damaged, expected the scores"):
        files.result()
