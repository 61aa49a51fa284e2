# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tables of a cross-validation, and of two beside each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mtpgo_core.quality.metrics import TIMES_S
from mtpgo_training.crossval.site_scores import (
    LEAST_AGENTS,
    MODEL,
    is_scored,
    pooled_scores,
    worse_than_simple,
)
from mtpgo_training.data.manoeuvres import MANOEUVRES
from mtpgo_training.evaluation.scores.score_summary import SINCE_START_GROUPS, value_text
from mtpgo_training.table_format import Row, Table

Json = dict[str, Any]

POOLED = "mean of sites"
"""Name of the average over sites."""

_HEADS = (
    "site, road users",
    "n",
    "ADE m",
    "/ CV",
    "/ CA",
    "minADE m",
    f"in 90% {'/'.join(f'{time:g}' for time in TIMES_S)} s",
    "sigma/RMSE",
    "nearest",
    "NLL",
)

_COMPARED = (
    ("ADE m", "ade"),
    ("minADE m", "min_ade"),
    ("brier-minFDE m", "brier_min_fde"),
    ("Brier", "brier"),
    ("nearest", "heaviest_nearest"),
    (f"in 90% {TIMES_S[-1]:g} s", f"{TIMES_S[-1]:g}"),
    ("NLL", "anll"),
    ("jump m", "jump"),
)
"""Columns of a comparison: title, and key of the value or time of the coverage."""

_CHANGES = ("nearest", f"in 90% {TIMES_S[-1]:g} s", "NLL")
"""Those that are compared by their difference; the others by their ratio."""


def scores_table(
    content: Json,
    tracker: str,
    *,
    manoeuvres: bool = False,
    since_start: bool = False,
    brier: bool = False,
) -> Table:
    """Return the scores of each left-out site and their mean, a row for each group.

    Moving road users come first. Groups of a site with fewer than :data:`LEAST_AGENTS` agents and
    instants are left out, except ``all``. A row whose ADE is more than 2 % above the better
    baseline's ends in ``!``.

    Args:
        content: of a cross-validation.
        tracker: what the observations come from, a key of ``scores``.
        manoeuvres: give the manoeuvres as well.
        since_start: give moving and turning ones by the time since the recording's start as well.
        brier: give the Brier score as well, for which a terminal is too narrow.
    """
    sites = {name: site["scores"][tracker] for name, site in left_out_sites(content).items()}
    rows = [
        row
        for site, scores in (sites | {POOLED: pooled_scores(list(sites.values()))}).items()
        for row in _site_rows(site, scores, manoeuvres, since_start, brier)
    ]
    return Table([*_HEADS, "Brier"] if brier else _HEADS, rows)


def left_out_sites(content: Json) -> dict[str, Json]:
    """Return recordings, scores and breakdowns of each left-out site, in the order of the folds.

    Args:
        content: of a cross-validation.
    """
    return {name: site for fold in content["folds"] for name, site in fold["sites"].items()}


def unscored_sites(content: Json) -> list[str]:
    """Return a sentence for each left-out site of which the tables have no row.

    Args:
        content: of a cross-validation.
    """
    sentences = []
    for name, site in left_out_sites(content).items():
        trackers = [tracker for tracker, scores in site["scores"].items() if not is_scored(scores)]
        if trackers:
            sentences.append(
                f"no road user of the site {name} could be scored (observations: "
                f"{', '.join(trackers)}), so it is missing in the tables: expected recordings in "
                f"which some are observed after they were predicted, not as short as "
                f"{', '.join(site['recordings'])}"
            )
    return sentences


def _shown_groups(scores: Json, manoeuvres: bool, since_start: bool) -> list[str]:
    """Return the groups that have a row, those of moving road users first."""
    shown = [
        group
        for group, row in scores.items()
        if row["n"] >= (1 if group == "all" else LEAST_AGENTS)
        and (manoeuvres or group == "standing" or group not in MANOEUVRES)
        and (since_start or group not in SINCE_START_GROUPS)
    ]
    return sorted(shown, key=_place)


def _place(group: str) -> int:
    """Return the place of a group in a table: moving ones, standing ones, all, others."""
    if group == "all":
        return 2
    kind = group.rsplit(" ", 1)[-1]
    return {"moving": 0, "standing": 1}.get(kind, 3)


def _nearest(row: Json) -> str:
    """Return the share in which the heaviest mode is the nearest, and that by chance."""
    share, chance = row["heaviest_nearest"], row.get("chance")  # earlier versions kept no chance
    text = value_text(share, 2)
    return text if share is None or chance is None else f"{text}/{value_text(chance, 2)}"


def _site_rows(
    site: str, scores: Json, manoeuvres: bool, since_start: bool, brier: bool
) -> list[Row]:
    rows = []
    for group in _shown_groups(scores, manoeuvres, since_start):
        row = scores[group]
        mark = " !" if worse_than_simple(row) else ""
        coverage = "-"  # of all: standing road users would hide what moving ones do
        if group != "all":
            at = row["coverage_90_at"]
            coverage = "/".join(value_text(at[f"{time:g}"], 2) for time in TIMES_S)
        rows.append(
            Row(
                f"{site}: {group}{mark}",
                [
                    str(row["n"]),
                    value_text(row["ade"]),
                    value_text(row["ratio_cv"], 2),
                    value_text(row["ratio_ca"], 2),
                    value_text(row["min_ade"]),
                    coverage,
                    value_text(row["sigma_to_rmse_at"][f"{TIMES_S[-1]:g}"], 2),
                    _nearest(row),
                    value_text(row["anll"], 2),
                    *([value_text(row.get("brier"))] if brier else ()),
                ],
            )
        )
    return rows


def trainings_table(content: Json) -> Table:
    """Return what each fold was trained with, and the sites that it leaves out."""
    heads = ("fold", "epochs", "share of scenes", "minutes", "validation ADE m", "sites left out")
    rows = []
    for fold in content["folds"]:
        training = fold["training"]
        rows.append(
            Row(
                fold["fold"],
                [
                    f"{training['epochs_done']} of {training['epochs']}",
                    f"{training['share']:.2f}",
                    f"{training['minutes']:.1f}",
                    value_text(training["validation_ade_m"]),
                    ", ".join(fold["sites"]),
                ],
            )
        )
    return Table(heads, rows)


def comparison_table(
    first: Json,
    second: Json,
    names: Sequence[str],
    *,
    manoeuvres: bool = False,
    since_start: bool = False,
) -> Table:
    """Return two cross-validations side by side: of each value the first, the second, the ratio.

    Values that neither of them has, such as jumps with a long stride, have no columns.
    Sites and groups that only one of them has, or has enough agents of, are left out, from the
    mean of sites as well, and the groups that :func:`scores_table` leaves out.

    Args:
        first: content of one.
        second: content of the other.
        names: of both, for the heads.
        manoeuvres: give the manoeuvres as well.
        since_start: give moving and turning ones by the time since the recording's start as well.
    """
    contents = [left_out_sites(content) for content in (first, second)]
    common = [site for site in contents[0] if site in contents[1]]
    pairs = {}
    trackers = [name for name in first["trackers"] if name in second["trackers"]]
    for tracker in trackers:
        pair = [[c[site]["scores"][tracker] for site in common] for c in contents]
        by_site = dict(zip(common, zip(*pair, strict=True), strict=True))
        counted = [_counted_in_both(*scores) for scores in by_site.values()]
        by_site[POOLED] = tuple(pooled_scores([both[i] for both in counted]) for i in range(2))
        for site, (one, other) in by_site.items():
            prefix = f"{site}, {tracker}" if len(trackers) > 1 else site
            also = _shown_groups(other, manoeuvres, since_start)
            for group in _shown_groups(one, manoeuvres, since_start):
                if group in also:
                    pairs[f"{prefix}: {group}"] = (one[group], other[group])
    known = [row for pair in pairs.values() for row in pair]
    columns = {
        title: key
        for title, key in _COMPARED
        if any(_compared_value(row, key) is not None for row in known)
    }
    heads = ["site, road users", "n"]
    for title in columns:
        heads += [f"{title} {names[0]}", names[1], "change" if title in _CHANGES else "ratio"]
    return Table(heads, [_compared_row(name, *pair, columns) for name, pair in pairs.items()])


def differences(first: Json, second: Json) -> list[str]:
    """Return in what two cross-validations differ that makes a comparison one of two things.

    Args:
        first: content of one.
        second: content of the other.
    """
    found = [
        f"{key} is {first[key]} and {second[key]}"
        for key in ("budget", "stride_s")
        if first[key] != second[key]
    ]
    if first["left_out_together"] != second["left_out_together"]:
        found.append(
            "other sites are left out together, so the models were trained on other sites"
        )
    horizons = [_horizon_s(content) for content in (first, second)]
    if None not in horizons and horizons[0] != horizons[1]:
        found.append(
            f"the models predict {horizons[0]:g} and {horizons[1]:g} s ahead, so their errors "
            "cannot be compared"
        )
    return found


def _horizon_s(content: Json) -> float | None:
    """Return the last time ahead that was scored (s), None where nothing was."""
    times = [
        protocols["all"]["time_s"][-1]
        for site in left_out_sites(content).values()
        for breakdowns in site.get("breakdowns", {}).values()
        for model, protocols in breakdowns.get("by_horizon", {}).items()
        if model == MODEL and "all" in protocols
    ]
    return max((time_s for time_s in times if time_s is not None), default=None)


def _counted_in_both(one: Json, other: Json) -> tuple[Json, Json]:
    """Return the groups of a site that have enough agents in both results."""
    names = [
        name
        for name in one
        if name in other and min(one[name]["n"], other[name]["n"]) >= LEAST_AGENTS
    ]
    return {name: one[name] for name in names}, {name: other[name] for name in names}


def _compared_value(row: Json, key: str) -> float | None:
    value: float | None = row["coverage_90_at"].get(key, row.get(key))
    return value


def _compared_row(name: str, one: Json, other: Json, columns: Mapping[str, str]) -> Row:
    n = str(one["n"]) if one["n"] == other["n"] else f"{one['n']}, {other['n']}"
    cells = [n]
    for title, key in columns.items():
        a, b = (_compared_value(row, key) for row in (one, other))
        digits = 3 if title.endswith(" m") or key == "brier" else 2
        cells += [value_text(a, digits), value_text(b, digits)]
        if a is None or b is None or (title not in _CHANGES and a == 0.0):
            cells.append("-")
        else:
            cells.append(f"{b - a:+.2f}" if title in _CHANGES else f"{b / a:.2f}")
    return Row(name, cells)


NOTE = (
    f"Groups with fewer than {LEAST_AGENTS} agents and instants at a site are left out. Every "
    f"site counts equally in the {POOLED} (ratios: geometric mean). '!': more than 2 % worse than "
    "the better of constant velocity (CV) and constant acceleration (CA). in 90%: share of the "
    "truths in the heaviest mode's 90 % ellipse. sigma/RMSE: standard deviation of the heaviest "
    f"mode over its error {TIMES_S[-1]:g} s ahead. nearest: share in which the heaviest mode is "
    "the nearest / share by chance. Brier: squared difference of weights and nearest mode, 0 "
    "is best."
)
"""Explains the tables."""
