# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options with limits: what is allowed, and the sentence of what is not."""

import math
from dataclasses import dataclass, fields

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import Limits, check_options, check_types, from_dict, option


@dataclass(frozen=True)
class Config:
    count: int = option(1, low=0)
    share: float = option(0.5, low=0.0, high=1.0)
    part: float = option(0.5, low=0.0, below=1.0)
    length_m: float = option(2.0, above=0.0)
    scale: float = option(1.0, above=0.0, below=math.inf)
    kind: str = option("cv", choices=("cv", "ca"), description="Which one.")
    kinds: tuple[str, ...] = option(("cv",), choices=("cv", "ca"))
    limit: float | None = option(None, low=3.0)
    free: float = -1.0

    def __post_init__(self) -> None:
        check_options(self, "section.")


def test_defaults_and_limit_values_are_allowed():
    Config()
    Config(count=0, share=1.0, part=0.0, length_m=1e-9, kind="ca", kinds=(), limit=3.0)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"count": -1}, "section.count is -1, expected at least 0"),
        ({"share": 1.5}, "section.share is 1.5, expected 0 to 1"),
        ({"part": 1.0}, "section.part is 1.0, expected 0 to less than 1"),
        ({"length_m": 0.0}, "section.length_m is 0.0, expected more than 0"),
        ({"length_m": math.nan}, "section.length_m is nan, expected more than 0"),
        ({"scale": math.inf}, "section.scale is inf, expected more than 0 and finite"),
        ({"kind": "x"}, "section.kind is 'x', expected one of 'cv', 'ca'"),
        ({"kinds": ("cv", "x")}, "section.kinds is 'x', expected one of 'cv', 'ca'"),
        ({"limit": 2.0}, "section.limit is 2.0, expected at least 3"),
    ],
)
def test_a_value_outside_of_its_limits_is_one_sentence(values, sentence):
    with pytest.raises(ConfigurationError) as caught:
        Config(**values)
    assert str(caught.value) == sentence


def test_limits_and_further_metadata_are_kept_with_the_field():
    kind = {field.name: field for field in fields(Config)}["kind"]
    assert kind.metadata["limits"] == Limits(choices=("cv", "ca"))
    assert kind.metadata["description"] == "Which one."
    assert kind.default == "cv"


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"count": 1.5}, "section.count is 1.5, expected int"),
        ({"count": True}, "section.count is True, expected int"),
        ({"kind": 3}, "section.kind is 3, expected str"),
        ({"kinds": 3}, "section.kinds is 3, expected a list"),
    ],
)
def test_a_value_of_another_type_is_one_sentence(values, sentence):
    config = Config()
    for name, value in values.items():
        object.__setattr__(config, name, value)
    with pytest.raises(ConfigurationError) as caught:
        check_types(config, "section.")
    assert str(caught.value) == sentence


def test_plain_data_becomes_the_dataclass():
    assert from_dict(Config, {"share": 1, "kinds": ["ca"]}, "c") == Config(
        share=1.0, kinds=("ca",)
    )
    with pytest.raises(
        ConfigurationError, match="c has the unknown field 'shape', expected count"
    ):
        from_dict(Config, {"shape": 1}, "c")
    with pytest.raises(ConfigurationError, match=r"c is \[\], expected a mapping of its fields"):
        from_dict(Config, [], "c")


def test_a_number_beyond_floating_point_is_one_sentence():
    with pytest.raises(ConfigurationError, match=r"^here\.share is a whole number beyond"):
        from_dict(Config, {"share": 10**400}, "here")
