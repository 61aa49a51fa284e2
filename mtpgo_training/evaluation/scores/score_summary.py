# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Breakdowns of a score table as plain data: intervals, groups, the horizon, calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from mtpgo_core.quality import metrics
from mtpgo_core.schema import BoolArray
from mtpgo_training.data.manoeuvres import MANOEUVRES, members
from mtpgo_training.evaluation.scores.agent_scores import LEVELS, STEP_KEYS
from mtpgo_training.evaluation.scores.bootstrap import (
    Array,
    bootstrap,
    bootstrap_ratio,
    pooled,
    resampling_counts,
)
from mtpgo_training.evaluation.scores.score_table import (
    HEADLINE_TIMES_S,
    SINCE_START_BANDS,
    Averages,
    ScoreTable,
    average,
    none,
    scores_by,
    totals,
)
from mtpgo_training.table_format import Row, Table

Json = dict[str, Any]

MOVING_TITLE = "moving 90% {:g}s"
"""Head of the share of moving agents in the heaviest mode's 90 % ellipse at a time (s)."""

TITLES = {
    "ade": "ADE m",
    "fde": "FDE m",
    "mr": "MR",
    "apde": "APDE m",
    "anll": "ANLL",
    "fnll": "FNLL",
    "min_ade": "minADE m",
    "min_fde": "minFDE m",
    **{key: MOVING_TITLE.format(time_s) for key, time_s in HEADLINE_TIMES_S.items()},
    "n": "agents",
}
"""Heads of the columns of tables."""

KDE_TITLES = {"anll_kde": "ANLL kde", "fnll_kde": "FNLL kde"}
"""Heads of the likelihoods by kernel density estimates, which are computed only if asked for."""

POOLED_TITLES = {"coverage_50": "in 50%", "coverage_90": "in 90%", "coverage_95": "in 95%"}
"""Heads of the coverages over all steps and agents."""

SINCE_START_GROUPS = {
    f"{kind}, {band} s": (kind, band)
    for kind in ("moving", "turning")
    for band in SINCE_START_BANDS
    if band != "unknown"
}
"""Names of moving and turning road users by the time since the recording's start. Turning ones are
apart, since what a model learns of a site while it runs is where its ways lead."""

REFERENCE = "cv"
"""The baseline relative to which the errors of the models are given."""

RELATIVE_KEYS = ("ade", "fde", "mr", "apde")
"""Errors that are given relative to the baseline."""

_SERIES = ["model", "protocol"]


def breakdowns(table: ScoreTable) -> Json:
    """Return breakdowns as plain data for JSON, by model and protocol; None for not defined.

    ``intervals``: by value, low and high end of the 95 % interval over recordings.
    ``relative``: by value, its share of constant velocity's, with low and high; nothing for a
    model of :func:`other_horizons`.
    ``by_class``, ``by_manoeuvre``, ``by_recording``: by name, the values. ``by_since_start``: by
    the names of :data:`SINCE_START_GROUPS`.
    ``by_horizon``: ``time_s`` and by value, lists over the horizon; ``displacement_low`` and
    ``_high`` are the ends of its interval, ``n`` the agents observed, ``nees_expected`` what the
    two NEES would be.
    ``reliability``: ``level`` and ``observed`` share in the ellipse of that level.
    """
    names, drawn = table.recordings, resampling_counts(len(table.recordings))
    others = other_horizons(table)
    agents = table.agents()
    by_recording = totals(agents, [*_SERIES, "recording"])
    headline = table.headline_totals([*_SERIES, "recording"]).reindex(by_recording.index)
    steps = totals(table.steps(), [*_SERIES, "recording", "step", "time_s"])
    levels = totals(table.levels(), [*_SERIES, "level"])
    content: Json = {
        "intervals": {},
        "relative": {},
        "by_class": _nested(scores_by(agents, [*_SERIES, "agent_class"])),
        "by_manoeuvre": _by_group(
            agents, {name: members(agents["manoeuvres"].to_numpy(), name) for name in MANOEUVRES}
        ),
        "by_since_start": _by_group(agents, since_start_groups(agents)),
        "by_recording": _nested(scores_by(agents, [*_SERIES, "recording"])),
        "by_horizon": {},
        "reliability": {},
    }
    for model, protocol in by_recording.index.droplevel("recording").unique():
        own = by_recording.loc[model, protocol].reindex(names, fill_value=0.0)
        parts = {
            "intervals": _intervals(own, drawn)
            | _intervals(headline.loc[model, protocol].reindex(names, fill_value=0.0), drawn),
            "relative": {},
            "by_horizon": _by_horizon(steps.loc[model, protocol], names, drawn),
            "reliability": _reliability(levels.loc[model, protocol]),
        }
        compared = (REFERENCE, protocol) in by_recording.index.droplevel("recording")
        if compared and model not in others:
            other = by_recording.loc[REFERENCE, protocol].reindex(names, fill_value=0.0)
            parts["relative"] = _relative(own, other, drawn)
        for key, value in parts.items():
            content[key].setdefault(model, {})[protocol] = value
    return content


def other_horizons(table: ScoreTable) -> dict[str, float]:
    """Return the models that predict farther or less far than the baselines, and how far (s).

    The baselines have the horizon of one of the models, and errors grow with the horizon.
    """
    known = table.horizons()
    own = known.get(REFERENCE, np.nan)
    return {model: time_s for model, time_s in known.items() if abs(time_s - own) > 1e-6}


def _nested(scores: Mapping[tuple[str, str, str], Any]) -> Json:
    """By model, protocol and name, what is given for the three together."""
    content: Json = {}
    for (model, protocol, name), value in scores.items():
        content.setdefault(model, {}).setdefault(protocol, {})[name] = value
    return content


def _intervals(own: pd.DataFrame, drawn: Array | None) -> Json:
    low, high = bootstrap(own["sum"].to_numpy(), own["count"].to_numpy(), drawn)
    return {key: [none(low[i]), none(high[i])] for i, key in enumerate(own["sum"].columns)}


def _relative(own: pd.DataFrame, other: pd.DataFrame, drawn: Array | None) -> Json:
    content: Json = {}
    for key in RELATIVE_KEYS:
        sums, counts = own["sum", key].to_numpy(), own["count", key].to_numpy()
        others, other_counts = other["sum", key].to_numpy(), other["count", key].to_numpy()
        if not counts.sum() or not others.sum():
            continue
        ratio = sums.sum() / counts.sum() / (others.sum() / other_counts.sum())
        low, high = bootstrap_ratio(sums, counts, others, other_counts, drawn)
        content[key] = {"value": float(ratio), "low": none(low), "high": none(high)}
    return content


def since_start_groups(labels: pd.DataFrame) -> dict[str, BoolArray]:
    """Return which rows belong to each of :data:`SINCE_START_GROUPS`.

    Args:
        labels: with the columns ``motion``, ``manoeuvres`` and ``since_start``.
    """
    band = labels["since_start"].astype(str).to_numpy()
    kinds = {
        "moving": labels["motion"].astype(str).to_numpy() == "moving",
        "turning": members(labels["manoeuvres"].to_numpy(), "turning"),
    }
    return {
        name: kinds[kind] & (band == wanted) for name, (kind, wanted) in SINCE_START_GROUPS.items()
    }


def _by_group(agents: pd.DataFrame, groups: Mapping[str, BoolArray]) -> Json:
    content: Json = {}
    for model, protocol in agents.groupby(_SERIES, observed=True).groups:
        content.setdefault(model, {})[protocol] = {}
    for name, rows in groups.items():
        some = agents[rows]
        for (model, protocol), scores in scores_by(some, _SERIES).items():
            if scores["n"]:
                content[model][protocol][name] = scores
    return content


def _by_horizon(steps: pd.DataFrame, names: Sequence[str], drawn: Array | None) -> Json:
    """Return lists over the horizon.

    Args:
        steps: sums, and as index recording, step and time.
        names: of all recordings.
        drawn: see :func:`resampling_counts`.
    """
    index = steps.index.to_frame(index=False)
    step = index["step"].to_numpy() - 1
    place = pd.Index(names).get_indexer(index["recording"])
    shape = (len(names), int(step.max()) + 1)
    times = np.full(shape[1], np.nan)
    times[step] = index["time_s"]

    def spread(part: str, key: str) -> Array:
        values = np.zeros(shape)
        values[place, step] = steps[part, key]
        return values

    content: Json = {
        "time_s": [none(time) for time in times],
        "nees_expected": metrics.EXPECTED_NEES,
        "n": spread("count", "displacement").sum(axis=0).tolist(),
    }
    for key in STEP_KEYS:
        sums, counts = spread("sum", key), spread("count", key)
        content[key] = [none(value) for value in pooled(sums, counts)]
        if key == "displacement":
            low, high = bootstrap(sums, counts, drawn)
            content["displacement_low"] = [none(value) for value in low]
            content["displacement_high"] = [none(value) for value in high]
    return content


def _reliability(levels: pd.DataFrame) -> Json:
    if not levels["count", "inside"].sum():
        return {}
    return {"level": list(LEVELS), "observed": average(levels)["inside"].tolist()}


def titles_of(*averages: Averages) -> dict[str, str]:
    """Return :data:`TITLES`, and of :data:`KDE_TITLES` those of which there are values."""
    rows = [
        row for found in averages for protocols in found.values() for row in protocols.values()
    ]
    given = (key for key in KDE_TITLES if any(row.get(key) is not None for row in rows))
    return TITLES | {key: KDE_TITLES[key] for key in given}


def averages_table(averages: Averages, protocol: str = "all") -> Table:
    """Return a row of averages for each model; columns without any value are left out.

    Args:
        averages: see :meth:`ScoreTable.averages`.
        protocol: ``all`` or ``centre``.
    """
    given = {name: row[protocol] for name, row in averages.items() if protocol in row}
    titles = TITLES | KDE_TITLES
    keys = [key for key in titles if any(row.get(key) is not None for row in given.values())]
    rows = [Row(name, [value_text(row.get(key)) for key in keys]) for name, row in given.items()]
    return Table(["", *(titles[key] for key in keys)], rows)


def value_text(value: float | None, digits: int = 3) -> str:
    """Return a value as it is shown in tables: counts as they are, ``-`` for not defined."""
    if isinstance(value, int):
        return str(value)
    return "-" if value is None else f"{value:.{digits}f}"
