# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Small YAML files are read with a limit, and errors name the line."""

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.yaml_file import LARGEST_FILE, read_yaml


def test_values_or_nodes_are_returned(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("a: 007\n")
    assert read_yaml(path, "a map") == {"a": 7}
    ((_, value),) = read_yaml(path, "a map", as_node=True).value
    assert value.value == "007"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"a: 1\nb: [\n", r"a\.yaml, line 3 cannot be read as YAML"),
        (b"\xff\xfe\xff", r"a\.yaml cannot be read as YAML"),
        (b"#" * (LARGEST_FILE + 1), r"larger than 262144 bytes, expected a map"),
    ],
)
def test_what_is_wrong_with_a_file_is_named(tmp_path, content, message):
    (tmp_path / "a.yaml").write_bytes(content)
    with pytest.raises(ConfigurationError, match=message):
        read_yaml(tmp_path / "a.yaml", "a map")
