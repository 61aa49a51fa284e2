# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Small YAML files are read with a limit, and errors name the line."""

import pytest
import yaml

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.yaml_file import LARGEST_FILE, dump_yaml, parse_yaml, read_yaml


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


@pytest.mark.parametrize(
    ("text", "value"),
    [("1e-3", 1e-3), ("-2.5E+3", -2500.0), (".5e1", 5.0), ("1_000e1", 10000.0), ("3e", "3e")],
)
def test_powers_of_ten_are_numbers_as_in_json(tmp_path, text, value):
    assert parse_yaml(f"a: {text}") == {"a": value}
    (tmp_path / "a.yaml").write_text(f"a: {text}")
    assert read_yaml(tmp_path / "a.yaml", "a map") == {"a": value}


def test_what_is_written_is_read_back():
    given = {"b": "1e3", "a": ["1", 2e-9, "1e-3", None, True, "no"], "c": {"2E5": 0.5}}
    assert parse_yaml(dump_yaml(given)) == given
    assert parse_yaml(dump_yaml(given, one_line=True)) == given
    assert list(parse_yaml(dump_yaml(given))) == ["b", "a", "c"]
    assert dump_yaml("a b", one_line=True) == "a b"


@pytest.mark.parametrize("text", ["a: 1\nb: 2\na: 3\n", "x: {a: 1, a: 1}\n", "- 1: a\n  1: b\n"])
def test_a_key_that_is_given_twice_is_refused(tmp_path, text):
    """One of the two values would be lost without a message."""
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(ConfigurationError, match=r"the key '[a1]' is given a second time"):
        read_yaml(tmp_path / "a.yaml", "a map")
    with pytest.raises(yaml.YAMLError, match="is given a second time"):
        parse_yaml(text)


def test_configurations_may_have_aliases():
    text = "a: &a {x: 1, y: 2}\nb: {<<: *a, x: 3}\n"
    assert parse_yaml(text) == {"a": {"x": 1, "y": 2}, "b": {"x": 3, "y": 2}}
