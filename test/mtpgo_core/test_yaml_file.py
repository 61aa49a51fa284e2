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
        (b"#" * (LARGEST_FILE + 1), r"larger than 65536 bytes, expected a map"),
        (b"a: 2024-99-99", r"cannot be read as YAML: a value is not of its kind \(month must be"),
        (b"a: !!bool maybe", r"cannot be read as YAML: a value is not of its kind"),
        (b"a: !!timestamp 5", r"cannot be read as YAML: a value is not of its kind"),
        (b"a: !!float 1.0" + b":10" * 900, r"cannot be read as YAML: a value is not of its kind"),
        (b"x: 1\na: 0x" + b"f" * 5000, r"yaml, line 2 cannot .*: a number of more than 100 char"),
        (b"a: 1" + b":10" * 9000, r"yaml, line 1 cannot .*: a number of more than 100 char"),
        (b"a: &a [x]\nb: *a\n", r"yaml, line 2 cannot be read as YAML: an alias \(\*name\), exp"),
        (b"a:\n- {<<: [*b, *b]}", r"yaml, line 2 cannot be read as YAML: an alias"),
        (
            b"[" * LARGEST_FILE,
            r"yaml, line 1 cannot .*: more than 20 levels of lists and mappings",
        ),
        (b"- " * (LARGEST_FILE // 2), r"more than 20 levels of lists and mappings"),
        (b"!" + b"a" * 9000, r"could not determine a constructor for the tag .{,200}$"),
    ],
)
def test_what_is_wrong_with_a_file_is_named(tmp_path, content, message):
    (tmp_path / "a.yaml").write_bytes(content)
    with pytest.raises(ConfigurationError, match=message) as caught:
        read_yaml(tmp_path / "a.yaml", "a map")
    assert "\n" not in str(caught.value)
