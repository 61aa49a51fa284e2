# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Sites by directory, location and configuration, folds of them, and the data without a fold."""

import dataclasses

import pytest
from tiny_run import CONFIG
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.crossval.site_folds import (
    Fold,
    FoldSite,
    chosen_folds,
    find_folds,
    find_sites,
    without_fold,
)
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.splits import NamedRecording


def named(source, name, location="1"):
    recording = dataclasses.replace(braking_cars(name, tracks=2, seconds=2.0), location=location)
    return NamedRecording(source, recording)


RECORDINGS = [
    named("ngsim", "01", "1"),
    named("ngsim", "02", "2"),
    named("ngsim", "03", "1"),
    named("i80", "01", "10"),
    named("lyon", "01"),
    named("lyon", "02"),
]


def as_dict(sites):
    return {site.name: site.recordings for site in sites}


def fold_of(*recordings):
    return Fold("one", (FoldSite("site", recordings),))


def configured(**data):
    return dataclasses.replace(CONFIG, data=DataConfig(**data))


def test_a_directory_is_a_site_and_so_is_each_of_its_locations():
    assert as_dict(find_sites(RECORDINGS, {})) == {
        "ngsim-1": ("ngsim/01", "ngsim/03"),
        "ngsim-2": ("ngsim/02",),
        "i80": ("i80/01",),
        "lyon": ("lyon/01", "lyon/02"),
    }


def test_the_configuration_names_and_merges_sites():
    sites = find_sites(
        RECORDINGS, {"us101": ["ngsim-1"], "others": ["i80", "lyon/02"], "rest": ["lyon/01"]}
    )
    assert as_dict(sites) == {
        "us101": ("ngsim/01", "ngsim/03"),
        "others": ("i80/01", "lyon/02"),
        "rest": ("lyon/01",),
        "ngsim-2": ("ngsim/02",),
    }


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"a": ["us101"]}, "crossval.sites.a names 'us101', expected a directory"),
        ({"a": ["i80"], "b": ["i80/01"]}, "i80/01 is in crossval.sites.a and in crossval.sites.b"),
    ],
)
def test_a_site_that_cannot_be_is_an_error(given, sentence):
    with pytest.raises(ConfigurationError, match=sentence):
        find_sites(RECORDINGS, given)


def test_each_site_is_left_out_in_one_fold():
    sites = find_sites(RECORDINGS, {})
    folds = find_folds(sites, {"half": ["lyon", "ngsim-2"]})
    assert {fold.name: [site.name for site in fold.sites] for fold in folds} == {
        "half": ["ngsim-2", "lyon"],
        "ngsim-1": ["ngsim-1"],
        "i80": ["i80"],
    }
    assert folds[0].recordings == {"ngsim/02", "lyon/01", "lyon/02"}
    assert [fold.name for fold in find_folds(sites, {})] == [site.name for site in sites]
    assert find_folds(sites, {"lyon": ["lyon", "i80"]})[0].name == "lyon"


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"a": ["us101"]}, r"crossval\.folds\.a names 'us101', expected sites of 'ngsim-1', "),
        (
            {"a": ["i80", "lyon"], "b": ["lyon"]},
            r"the site lyon is in crossval\.folds\.a and in crossval\.folds\.b, expected one",
        ),
        ({"i80": ["lyon"]}, r"crossval\.folds\.i80 has the name of a site that it does not"),
        ({"a": ["ngsim-1", "ngsim-2", "i80", "lyon"]}, "one fold leaves out all sites"),
    ],
)
def test_a_fold_that_cannot_be_is_an_error(given, sentence):
    with pytest.raises(ConfigurationError, match=sentence):
        find_folds(find_sites(RECORDINGS, {}), given)


def test_folds_are_chosen_by_name_or_by_a_site_in_them():
    folds = find_folds(find_sites(RECORDINGS, {}), {"half": ["lyon", "ngsim-2"]})

    def names(chosen):
        return [fold.name for fold in chosen_folds(folds, chosen)]

    assert names(None) == ["half", "ngsim-1", "i80"]
    assert names(["i80", "lyon", "half", "ngsim-2"]) == ["i80", "half"]
    with pytest.raises(ConfigurationError, match=r"--folds names 'i81', expected .*, 'half'"):
        chosen_folds(folds, ["i81"])


def test_the_other_sites_keep_their_uses_without_the_tests():
    config = configured(validation=("ngsim/03", "lyon/01"), test=("i80/01",))
    fold, others = without_fold(config, RECORDINGS, fold_of("ngsim/01", "ngsim/03"))
    assert [item.name for item in others] == ["ngsim/02", "lyon/01", "lyon/02"]
    assert fold.data.validation == ("lyon/01",)
    assert (fold.data.train, fold.data.test) == ((), ())


def test_only_the_configured_recordings_are_trained_on():
    config = configured(train=("ngsim/02", "lyon/02"), validation=("lyon/01",), test_fraction=0.3)
    _, others = without_fold(config, RECORDINGS, fold_of("i80/01"))
    assert [item.name for item in others] == ["ngsim/02", "lyon/01", "lyon/02"]


def test_validation_is_drawn_where_the_site_took_it_all():
    config = configured(validation=("i80/01",), validation_fraction=0.2)
    fold, others = without_fold(config, RECORDINGS, fold_of("i80/01"))
    assert fold.data.validation == ()
    assert fold.data.validation_fraction == 0.2
    assert len(others) == 5


def test_weights_of_the_left_out_site_are_dropped():
    weights = {"i80": 0.5, "i80/01": 0.1, "lyon": 0.3, "lyon/02": 2.0}
    config = configured(validation=("lyon/01",), source_weight=weights)
    fold, _ = without_fold(config, RECORDINGS, fold_of("i80/01"))
    assert fold.data.source_weight == {"lyon": 0.3, "lyon/02": 2.0}


def test_with_blocks_of_time_all_other_recordings_are_used():
    config = configured(split="time", validation_fraction=0.2)
    fold, others = without_fold(config, RECORDINGS, fold_of("lyon/01", "lyon/02"))
    assert [item.name for item in others] == ["ngsim/01", "ngsim/02", "ngsim/03", "i80/01"]
    assert fold.data == config.data


def test_all_sites_of_a_fold_are_left_out_together():
    config = configured(train=("ngsim/02", "lyon/02", "i80/01"), validation=("lyon/01",))
    fold = Fold("two", (FoldSite("a", ("i80/01",)), FoldSite("b", ("lyon/01",))))
    part, others = without_fold(config, RECORDINGS, fold)
    assert [item.name for item in others] == ["ngsim/02", "lyon/02"]
    assert part.data.validation == ()


def test_nothing_left_to_train_on_is_an_error():
    config = configured(train=("i80/01",), validation=("lyon/01",))
    with pytest.raises(ConfigurationError, match=r"no recording is left in data\.train without"):
        without_fold(config, RECORDINGS, fold_of("i80/01"))
