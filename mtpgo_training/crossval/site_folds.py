# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Sites of recordings, folds of sites, and the training data that is left without a fold.

A site is a directory of recordings. Where a directory has recordings of several locations, each
location is a site of its own, ``DIRECTORY-LOCATION``. A fold is a training without one or several
sites, each of which is scored by itself. The section ``crossval`` of the configuration may name
and merge sites, and say which sites are left out together.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import listed
from mtpgo_training.data.splits import NamedRecording, split
from mtpgo_training.training.training_config import TrainingConfig


@dataclass(frozen=True)
class FoldSite:
    """The recordings of a site, which are scored together.

    Attributes:
        name: name of the site.
        recordings: their names, ``DIRECTORY/NAME``.
    """

    name: str
    recordings: tuple[str, ...]


@dataclass(frozen=True)
class Fold:
    """The sites that one training leaves out.

    Attributes:
        name: name of the fold.
        sites: the sites, each scored by itself.
    """

    name: str
    sites: tuple[FoldSite, ...]

    @property
    def recordings(self) -> frozenset[str]:
        """Names of the recordings of all its sites."""
        return frozenset(name for site in self.sites for name in site.recordings)


def find_sites(
    recordings: Sequence[NamedRecording], named: Mapping[str, Sequence[str]]
) -> list[FoldSite]:
    """Return the sites of all recordings, the named ones first.

    Args:
        recordings: all recordings.
        named: ``crossval.sites`` of the configuration. Each entry is a directory, a site as it
            would be called without this option, or a recording (``DIRECTORY/NAME``).

    Raises:
        ConfigurationError: an entry names nothing, or a recording is in two sites.
    """
    automatic = automatic_sites(recordings)
    groups: dict[str, list[str]] = {}
    for item in recordings:
        for group in {item.source, automatic[item.name], item.name}:
            groups.setdefault(group, []).append(item.name)
    site_of: dict[str, str] = {}
    for site, entries in named.items():
        for entry in entries:
            if entry not in groups:
                raise ConfigurationError(
                    f"crossval.sites.{site} names {entry!r}, expected a directory, a recording "
                    f"(DIRECTORY/NAME) or one of {listed(dict.fromkeys(automatic.values()))}"
                )
            for name in groups[entry]:
                if site_of.setdefault(name, site) != site:
                    raise ConfigurationError(
                        f"the recording {name} is in crossval.sites.{site_of[name]} and in "
                        f"crossval.sites.{site}, expected one site"
                    )
    for item in recordings:
        site_of.setdefault(item.name, automatic[item.name])
    names = dict.fromkeys([*named, *(site_of[item.name] for item in recordings)])
    sites = [
        FoldSite(name, tuple(r.name for r in recordings if site_of[r.name] == name))
        for name in names
    ]
    return [site for site in sites if site.recordings]


def find_folds(sites: Sequence[FoldSite], named: Mapping[str, Sequence[str]]) -> list[Fold]:
    """Return the folds, the named ones first; a site in none of them has a fold of its own.

    Args:
        sites: all sites.
        named: ``crossval.folds`` of the configuration: names of sites by the name of the fold.

    Raises:
        ConfigurationError: a name is no site, a site is in two folds, a fold has the name of a
            site outside it, or there is one fold only, without which no site is left.
    """
    by_name = {site.name: site for site in sites}
    fold_of: dict[str, str] = {}
    for fold, entries in named.items():
        for entry in entries:
            if entry not in by_name:
                raise ConfigurationError(
                    f"crossval.folds.{fold} names {entry!r}, expected sites of {listed(by_name)}"
                )
            if fold_of.setdefault(entry, fold) != fold:
                raise ConfigurationError(
                    f"the site {entry} is in crossval.folds.{fold_of[entry]} and in "
                    f"crossval.folds.{fold}, expected one fold"
                )
        if fold in by_name and fold not in entries:
            raise ConfigurationError(
                f"crossval.folds.{fold} has the name of a site that it does not leave out, "
                "expected another name"
            )
    for name in by_name:
        fold_of.setdefault(name, name)
    folds = [
        Fold(fold, tuple(site for site in sites if fold_of[site.name] == fold))
        for fold in dict.fromkeys([*named, *fold_of.values()])
    ]
    if len(folds) < 2:
        raise ConfigurationError(
            f"one fold leaves out all sites ({', '.join(by_name)}), expected at least two folds"
        )
    return folds


def chosen_folds(folds: Sequence[Fold], names: Iterable[str] | None) -> list[Fold]:
    """Return folds by their own name or that of a site in them, all folds for None.

    Raises:
        ConfigurationError: a name is that of no fold and no site.
    """
    by_name = {site.name: fold for fold in folds for site in fold.sites}
    by_name |= {fold.name: fold for fold in folds}
    for name in names or ():
        if name not in by_name:
            raise ConfigurationError(
                f"--folds names {name!r}, expected a fold or a site in it, of {listed(by_name)}"
            )
    chosen = folds if names is None else [by_name[name] for name in names]
    return list({fold.name: fold for fold in chosen}.values())


def without_fold(
    config: TrainingConfig, recordings: Sequence[NamedRecording], fold: Fold
) -> tuple[TrainingConfig, list[NamedRecording]]:
    """Return configuration and recordings of a training without the sites of a fold.

    With ``data.split: recording`` the recordings of the other sites keep the use that the
    configuration gives them; those for the test are left out. Where no recording of another site
    is for validation, some are drawn by ``data.validation_fraction``. With ``time`` the blocks of
    the other sites' recordings are assigned anew.

    Args:
        config: the configuration of the cross-validation.
        recordings: all recordings.
        fold: the sites that are left out.

    Raises:
        ConfigurationError: no recording is left to train on.
    """
    data, left_out = config.data, fold.recordings
    others = [item for item in recordings if item.name not in left_out]
    if data.split == "recording":
        splits = split(recordings, data, config.seed)
        train, validation = (
            {item.name for item in part} - left_out for part in (splits.train, splits.validation)
        )
        if not train:
            raise ConfigurationError(
                f"no recording is left in data.train without {fold.name!r}, expected recordings "
                "of other sites"
            )
        others = [item for item in others if item.name in train | validation]
        data = dataclasses.replace(
            data, train=(), validation=tuple(sorted(validation)), test=(), test_fraction=0.0
        )
    known = {item.name for item in others} | {item.source for item in others}
    weights = {name: w for name, w in data.source_weight.items() if name in known}
    data = dataclasses.replace(data, source_weight=weights)
    return dataclasses.replace(config, data=data), others


def automatic_sites(recordings: Sequence[NamedRecording]) -> dict[str, str]:
    """Return the site of each recording by directory and location."""
    locations: dict[str, set[str]] = {}
    for item in recordings:
        locations.setdefault(item.source, set()).add(item.recording.location)
    return {
        item.name: item.source
        if len(locations[item.source]) == 1
        else f"{item.source}-{item.recording.location or 'unknown'}"
        for item in recordings
    }
