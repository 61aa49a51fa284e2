# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The results of a study as plain data: means over seeds with intervals, gaps, the rankings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mtpgo_training.evaluation.scores.bootstrap import over_seeds
from mtpgo_training.evaluation.scores.score_table import none
from mtpgo_training.study.paper_tables import BY_KERNELS, PAPER
from mtpgo_training.study.study_folder import StudyFolder
from mtpgo_training.study.study_rows import Study, StudyRow
from mtpgo_training.study.study_run import MODEL, missing_text

Json = dict[str, Any]


def results(
    study: Study,
    data_set: str,
    folder: StudyFolder,
    rows: Sequence[StudyRow],
    seeds: Sequence[int],
    refused: Mapping[str, str],
) -> Json:
    """Return the results so far, as JSON can write them.

    ``rows``: for each row its ``name``, ``title``, ``seeds`` that are done, ``values`` by column
    (``mean``, ``low``, ``high``, ``seeds``), ``cv`` by column (constant velocity for the same
    road users), ``kernels`` (the same by kernel density estimates), ``paper`` by column, ``gap``
    (why it is not complete, None if it is), and the ``training`` of each seed. ``rankings``: of
    each column of ADE, the rows from the smallest on. With classes each has its own, since a row
    may be the best for one class and worse than constant velocity for another.

    Args:
        study: which one.
        data_set: of the paper.
        folder: of the study.
        rows: of the table.
        seeds: of each row.
        refused: why a row cannot be trained, by its name.
    """
    done = {
        row.name: [
            scores
            for seed in seeds
            if row.is_trained and (scores := folder.run(row.name, seed).result()) is not None
        ]
        for row in rows
    }
    any_run = next((scores[0] for scores in done.values() if scores), None)
    found = []
    for row in rows:
        if row.is_trained:
            runs, series, missing = done[row.name], MODEL, _gap(folder, row, seeds, refused)
        else:
            runs, series = [any_run] if any_run else [], row.name
            missing = None if any_run else "no run has scored it yet"
        found.append(_row_results(study, data_set, row, runs, series, missing))
    return {
        "study": study.name,
        "data_set": data_set,
        "columns": list(study.columns),
        "rows": found,
        "rankings": {key: ranking(found, key) for key in study.columns if _is_ade(key)},
    }


def _row_results(
    study: Study,
    data_set: str,
    row: StudyRow,
    runs: Sequence[Json],
    series: str,
    missing: str | None,
) -> Json:
    """Return the results of a row, see :func:`results`.

    Args:
        study: which one.
        data_set: of the paper.
        row: of the table.
        runs: results of the runs whose scores are its.
        series: name of its scores in these results.
        missing: why it is not complete, None if it is.
    """
    trained = runs if row.is_trained else []  # a baseline has neither seeds nor a training
    paper = PAPER[study.name].get(data_set, {}).get(row.name, {})
    by_kernels = ("anll", "fnll") if row.is_trained else ()
    return {
        "name": row.name,
        "title": row.title,
        "removed": row.removed,
        "trained": row.is_trained,
        "seeds": [run["seed"] for run in trained],
        "values": {key: _mean(runs, series, key) for key in study.columns},
        "cv": {key: _mean(runs, "cv", key) for key in study.columns} if row.is_trained else {},
        "kernels": {key: _mean(runs, series, f"{key}_kde") for key in by_kernels},
        "paper": {
            key: {"value": value.value, "half_width": value.half_width}
            for key, value in paper.items()
        },
        "paper_by_kernels": row.name in BY_KERNELS,
        "gap": missing,
        "training": [run["training"] for run in trained],
        "extrapolation": [run["extrapolation"] for run in trained if "extrapolation" in run],
    }


def _gap(
    folder: StudyFolder, row: StudyRow, seeds: Sequence[int], refused: Mapping[str, str]
) -> str | None:
    """Return why runs of a row are missing, None if none is."""
    if row.name in refused:
        return refused[row.name]
    return missing_text({seed: folder.run(row.name, seed) for seed in seeds})


def _is_ade(column: str) -> bool:
    return column.rpartition(".")[2] == "ade"


def _value(scores: Json, series: str, key: str) -> float | None:
    kind, _, value = key.rpartition(".")
    if kind:
        found = scores["by_class"].get(series, {}).get(kind, {}).get(value)
    else:
        found = scores["values"].get(series, {}).get(value)
    return None if found is None else float(found)


def _mean(runs: Sequence[Json], series: str, key: str) -> Json | None:
    """Return mean and interval over the runs that have a value, None if none has."""
    given = [v for one in runs if (v := _value(one, series, key)) is not None]
    if not given:
        return None
    mean, low, high = over_seeds(given)
    return {"mean": mean, "low": none(low), "high": none(high), "seeds": len(given)}


def half_width(value: Json) -> float | None:
    """Return half of the length of an interval, None if there is none."""
    return None if value["high"] is None else value["high"] - value["mean"]


def ranking(rows: Sequence[Json], column: str) -> list[Json]:
    """Return the rows from the smallest value on.

    ``value`` is that of the column; ``apart``: whether its interval and that of the row before do
    not overlap, None where there is none (a baseline is not trained: its value is compared with
    the interval of the other row); ``cv``: constant velocity for the same road users;
    ``beats_cv``: whether the mean is below it, None of baselines and where it is unknown.

    Args:
        rows: see :func:`results`.
        column: by which they are ranked.
    """
    known = [row for row in rows if row["values"][column] is not None]
    known.sort(key=lambda row: row["values"][column]["mean"])
    found: list[Json] = []
    before: Json | None = None
    for row in known:
        value = row["values"][column]
        apart = None
        if before is not None and (before["trained"] or row["trained"]):
            low = value["low"] if row["trained"] else value["mean"]
            other = before["values"][column]
            high = other["high"] if before["trained"] else other["mean"]
            apart = None if None in (low, high) else bool(low > high)
        cv = row["cv"].get(column)
        beats = None if cv is None else value["mean"] < cv["mean"]
        found.append(
            {
                "name": row["name"],
                "title": row["title"],
                "value": value,
                "cv": cv,
                "apart": apart,
                "beats_cv": beats,
            }
        )
        before = row
    return found
