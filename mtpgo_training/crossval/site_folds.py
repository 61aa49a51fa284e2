# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Sites of recordings, and the training data that is left without one of them.

A site is a directory of recordings. Where a directory has recordings of several locations, each
location is a site of its own, ``DIRECTORY-LOCATION``. The section ``crossval`` of the
configuration may give names to sites and merge them.
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
    """The recordings that are left out together.

    Attributes:
        name: name of the site.
        recordings: their names, ``DIRECTORY/NAME``.
    """

    name: str
    recordings: tuple[str, ...]


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


def chosen_sites(sites: Sequence[FoldSite], names: Iterable[str] | None) -> list[FoldSite]:
    """Return the sites with these names, all of them for None.

    Raises:
        ConfigurationError: a name is unknown, or there is one site only.
    """
    if len(sites) < 2:
        raise ConfigurationError(
            f"the recordings are of one site ({', '.join(s.name for s in sites)}), expected at "
            "least two to train without one of them"
        )
    by_name = {site.name: site for site in sites}
    for name in names or ():
        if name not in by_name:
            raise ConfigurationError(f"--sites names {name!r}, expected {listed(by_name)}")
    return [by_name[name] for name in dict.fromkeys(names or by_name)]


def without_site(
    config: TrainingConfig, recordings: Sequence[NamedRecording], site: FoldSite
) -> tuple[TrainingConfig, list[NamedRecording]]:
    """Return configuration and recordings of a training without a site.

    With ``data.split: recording`` the recordings of the other sites keep the use that the
    configuration gives them; those for the test are left out. Where no recording of another site
    is for validation, some are drawn by ``data.validation_fraction``. With ``time`` the blocks of
    the other sites' recordings are assigned anew.

    Args:
        config: the configuration of the cross-validation.
        recordings: all recordings.
        site: the site that is left out.

    Raises:
        ConfigurationError: no recording is left to train on.
    """
    data = config.data
    others = [item for item in recordings if item.name not in site.recordings]
    if data.split == "recording":
        splits = split(recordings, data, config.seed)
        train, validation = (
            {item.name for item in part} - set(site.recordings)
            for part in (splits.train, splits.validation)
        )
        if not train:
            raise ConfigurationError(
                f"no recording is left in data.train without the site {site.name!r}, expected "
                "recordings of other sites"
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
