# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a score book tells beyond its averages: intervals, groups, the horizon, calibration."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import AgentClass
from mtpgo_training.data.manoeuvres import MANOEUVRES, members
from mtpgo_training.evaluation import metrics
from mtpgo_training.evaluation.bootstrap import bootstrap, bootstrap_ratio, draws, over_seeds
from mtpgo_training.evaluation.scorebook import ScoreBook, Scores, averages
from mtpgo_training.evaluation.scorepage import KEYS, LEVELS, STEP_KEYS, Page
from mtpgo_training.scenes.kinematic_baselines import BASELINES

Json = dict[str, Any]
Array = NDArray[np.float64]

REFERENCE = "cv"
"""The baseline to whose ADE, FDE and so on those of the models are put in proportion."""

RELATIVE_KEYS = ("ade", "fde", "mr", "apde")

_SEED = re.compile(r"(?P<recipe>.+?)[-_.]?seed[-_]?(?P<seed>\d+)$")


def details(book: ScoreBook) -> Json:
    """Plain data for JSON beside the averages, each by model and protocol; None for not defined.

    ``intervals``: by value, low and high end of the 95 % interval over recordings.
    ``relative``: by value, its share of constant velocity's, with low and high.
    ``by_class``, ``by_manoeuvre``, ``by_recording``: by name, the values.
    ``by_horizon``: ``time_s`` and by value, lists over the horizon; ``displacement_low`` and
    ``_high`` are the ends of its interval, ``n`` the agents observed, ``nees_expected`` what the
    two NEES would be.
    ``reliability``: ``level`` and ``observed`` share in the ellipse of that level.
    """
    names = book.recordings
    drawn = draws(len(names))
    series = dict(sorted(book.series().items(), key=lambda item: item[0][0] in BASELINES))
    content: Json = {key: {} for key in _PARTS}
    for (model, protocol), pages in series.items():
        ordered = [pages.get(name, Page()) for name in names]
        reference = series.get((REFERENCE, protocol))
        others = None if reference is None else [reference.get(name, Page()) for name in names]
        parts = {
            "intervals": _intervals(ordered, drawn),
            "relative": {} if others is None else _relative(ordered, others, drawn),
            "by_class": _by_class(ordered),
            "by_manoeuvre": _by_manoeuvre(ordered),
            "by_recording": {n: _plain(averages([p])) for n, p in pages.items()},
            "by_horizon": _by_horizon(ordered, book.step_s, drawn),
            "reliability": _reliability(ordered),
        }
        for key, value in parts.items():
            content[key].setdefault(model, {})[protocol] = value
    return content


_PARTS = (
    "intervals",
    "relative",
    "by_class",
    "by_manoeuvre",
    "by_recording",
    "by_horizon",
    "reliability",
)


def seed_groups(models: Sequence[str], all_together: bool = False) -> dict[str, list[str]]:
    """Models of one recipe that differ in their seed: ``x-seed1`` and ``x-seed2`` make ``x``.

    Args:
        models: names.
        all_together: all of them are of one recipe, whatever their names.
    """
    if all_together:
        return {"seeds": list(models)}
    groups: dict[str, list[str]] = {}
    for name in models:
        found = _SEED.match(name)
        if found:
            groups.setdefault(found["recipe"], []).append(name)
    return {recipe: names for recipe, names in groups.items() if len(names) > 1}


def over_groups(
    models: Mapping[str, Mapping[str, Mapping[str, float | None]]],
    groups: Mapping[str, Sequence[str]],
) -> Json:
    """By group, ``models``; by protocol, each value's ``mean``, ``low`` and ``high`` over them."""
    content: Json = {}
    for group, names in groups.items():
        content[group] = {"models": list(names)}
        for protocol in models[names[0]]:
            row: Json = {}
            for key in KEYS:
                values = [models[name][protocol][key] for name in names]
                given = [value for value in values if value is not None]
                if len(given) == len(values):
                    mean, low, high = over_seeds(given)
                    row[key] = {"mean": mean, "low": none(low), "high": none(high)}
            content[group][protocol] = row
    return content


def none(value: float) -> float | None:
    """The value, or None for NaN, which JSON lacks."""
    return None if np.isnan(value) else float(value)


def _plain(scores: Scores) -> dict[str, float | None]:
    """Like :meth:`ScoreTable.to_dict`: counts stay whole numbers."""
    return {key: None if np.isnan(value) else value for key, value in scores.items()}


def _sums(pages: Sequence[Page], keys: Sequence[str]) -> tuple[Array, Array]:
    """[R, keys] sums over the agents of each recording, and over how many."""
    sums, counts = np.zeros((len(pages), len(keys))), np.zeros((len(pages), len(keys)))
    for i, page in enumerate(pages):
        for j, key in enumerate(keys):
            values = page.values(key)
            known = np.isfinite(values)
            sums[i, j], counts[i, j] = values[known].sum(dtype=np.float64), known.sum()
    return sums, counts


def _intervals(pages: Sequence[Page], drawn: Array | None) -> Json:
    low, high = bootstrap(*_sums(pages, KEYS), drawn)
    return {key: [none(low[i]), none(high[i])] for i, key in enumerate(KEYS)}


def _relative(pages: Sequence[Page], others: Sequence[Page], drawn: Array | None) -> Json:
    own, own_n = _sums(pages, RELATIVE_KEYS)
    other, other_n = _sums(others, RELATIVE_KEYS)
    content: Json = {}
    for i, key in enumerate(RELATIVE_KEYS):
        if not own_n[:, i].sum() or not other[:, i].sum():
            continue
        ratio = own[:, i].sum() / own_n[:, i].sum() / (other[:, i].sum() / other_n[:, i].sum())
        low, high = bootstrap_ratio(own[:, i], own_n[:, i], other[:, i], other_n[:, i], drawn)
        content[key] = {"value": float(ratio), "low": none(low), "high": none(high)}
    return content


def _by_class(pages: Sequence[Page]) -> Json:
    present = sorted({int(c) for page in pages for c in np.unique(page.classes())})
    return {
        AgentClass(kind).name.lower(): _plain(
            averages(pages, [page.classes() == kind for page in pages])
        )
        for kind in present
    }


def _by_manoeuvre(pages: Sequence[Page]) -> Json:
    found: Json = {}
    for name in MANOEUVRES:
        scores = averages(pages, [members(page.labels(), name) for page in pages])
        if scores["n"]:
            found[name] = _plain(scores)
    return found


def _by_horizon(pages: Sequence[Page], step_s: float, drawn: Array | None) -> Json:
    steps = max((len(page.step_counts["displacement"]) for page in pages), default=0)

    def stacked(arrays: Sequence[NDArray[np.floating]]) -> Array:
        padded = [np.pad(a.astype(np.float64), (0, steps - len(a))) for a in arrays]
        return np.stack(padded)

    content: Json = {
        "time_s": [none(round(step_s * k, 6)) for k in range(1, steps + 1)],
        "nees_expected": metrics.EXPECTED_NEES,
        "n": stacked([p.step_counts["displacement"] for p in pages]).sum(axis=0).tolist(),
    }
    for key in STEP_KEYS:
        sums = stacked([page.step_sums[key] for page in pages])
        counts = stacked([page.step_counts[key] for page in pages])
        total = counts.sum(axis=0)
        mean = np.where(total > 0, sums.sum(axis=0) / np.maximum(total, 1), np.nan)
        content[key] = [none(v) for v in mean.tolist()]
        if key == "displacement":
            low, high = bootstrap(sums, counts, drawn)
            content["displacement_low"] = [none(v) for v in low.tolist()]
            content["displacement_high"] = [none(v) for v in high.tolist()]
    return content


def _reliability(pages: Sequence[Page]) -> Json:
    count = sum(page.inside_count for page in pages)
    if not count:
        return {}
    observed = sum((page.inside for page in pages), np.zeros(len(LEVELS))) / count
    return {"level": list(LEVELS), "observed": observed.tolist()}
