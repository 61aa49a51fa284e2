# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Origins of sites that a configuration asks for, of recordings of several directories."""

import dataclasses

import pytest
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import from_dict
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.training.recipes import configured_origins
from mtpgo_training.training.recipes.configured_origins import with_site_origins
from mtpgo_training.training.training_config import TrainingConfig


def config(**origins):
    scene = {"frame": "site_origin", "site_origins": origins}
    given = {"data": {"find_site_origins": "junction"}, "scene": scene}
    return from_dict(TrainingConfig, given, "the test")


@pytest.fixture
def recordings(monkeypatch):
    """Location 1 of two directories, and location 2 of one of them."""
    monkeypatch.setattr(
        configured_origins, "find_origin", lambda some, kind: (float(len(some)), 0.0)
    )
    made = braking_cars("01", tracks=2, seconds=2.0)
    return [
        NamedRecording(source, dataclasses.replace(made, name=name, location=location))
        for source, name, location in (
            ("a", "01", "1"),
            ("a", "02", "1"),
            ("b", "01", "2"),
            ("b", "02", "1"),
        )
    ]


def test_each_location_of_one_directory_has_an_origin(recordings):
    found = with_site_origins(config(), recordings[:3])
    assert found.scene.site_origins == {"1": (2.0, 0.0), "2": (1.0, 0.0)}


def test_a_location_of_two_directories_is_refused_unless_its_origin_is_given(recordings):
    expected = r"location '1' occurs in 'a', 'b', expected one directory .* scene\.site_origins"
    with pytest.raises(ConfigurationError, match=expected):
        with_site_origins(config(), recordings)
    given = with_site_origins(config(**{"1": (5.0, 6.0)}), recordings)
    assert given.scene.site_origins == {"1": (5.0, 6.0), "2": (1.0, 0.0)}
