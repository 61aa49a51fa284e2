# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The results of a sweep: one table with means and spreads over the seeds."""

from __future__ import annotations

import csv
import io
import json
import statistics
from collections.abc import Sequence
from typing import Any

from mtpgo_core.quality.metrics import MOVING_COVERAGE_KEY
from mtpgo_training.atomic_files import write_text
from mtpgo_training.calibration.calibration_text import moving_coverage
from mtpgo_training.evaluation.scores.score_summary import MOVING_TITLE
from mtpgo_training.study.study_run import missing_text
from mtpgo_training.sweep.sweep_folder import SweepFolder
from mtpgo_training.sweep.sweep_grid import GridPoint, setting_text
from mtpgo_training.table_format import Row, Table, to_markdown

Json = dict[str, Any]

SCORES = {
    "ade": "ADE m",
    "fde": "FDE m",
    "mr": "MR",
    "min_ade": "minADE m",
    "anll": "ANLL",
}
"""Score of the validation -> title; the coverage of moving road users comes after them."""

CRITERION = "ade"
"""Score by which a combination is the best."""

NOTE = (
    "Validation recordings, all road users, the best epoch of each run: mean ± standard deviation "
    "over the seeds. moving 90%: share of moving road users inside the heaviest mode's 90 % "
    "ellipse at that time."
)


def score_columns(runs: Sequence[Json]) -> dict[str, str]:
    """Return the titles of :data:`SCORES` and of the coverage of moving road users.

    The coverage is that of the last time that a run has, see
    :func:`~mtpgo_core.quality.metrics.headline_time_s`; runs with other horizons have another
    column.

    Args:
        runs: results of the runs that are done; those of earlier versions may have no coverage.
    """
    times = (moving_coverage(run["values"]["model"]) for run in runs)
    last = sorted({max(shares) for shares in times if shares})
    return SCORES | {MOVING_COVERAGE_KEY.format(t): MOVING_TITLE.format(t) for t in last}


def results(folder: SweepFolder, points: Sequence[GridPoint]) -> Json:
    """Return what is known by now.

    ``rows``: for each combination its ``settings``, ``seeds`` that are done, ``values`` by score
    (``mean``, ``spread``: the standard deviation over the seeds, None for a single one), mean
    ``minutes``, ``parameters``, and ``gap``: why it is not complete, None if it is. ``best``: name
    of the best run of the best combination, by the mean of the ADE. ``baselines``: scores of
    constant velocity and others. ``comparable``: all runs were validated on the same recordings.
    ``same_horizon``: all runs predict the same times; if not, there is no best one, and there are
    no baselines that all could be compared with.

    Args:
        folder: of the sweep.
        points: all combinations.
    """
    groups: dict[tuple[tuple[str, str], ...], list[GridPoint]] = {}
    for point in points:
        groups.setdefault(point.settings, []).append(point)
    rows: list[Json] = []
    runs: list[Json] = []
    for settings, group in groups.items():
        files = {point.seed: folder.run(point.name) for point in group}
        done = [scores for one in files.values() if (scores := one.result()) is not None]
        runs += done
        trained = [one["training"] for one in done]
        rows.append(
            {
                "settings": dict(settings),
                "seeds": [one["seed"] for one in done],
                "done": done,
                "minutes": statistics.fmean(t["minutes"] for t in trained) if trained else None,
                "parameters": trained[0]["parameters"] if trained else None,
                "gap": missing_text(files),
            }
        )
    columns = score_columns(runs)
    for row in rows:
        done = row.pop("done")
        row["values"] = {key: _mean(done, key) for key in columns}
    known = [row for row in rows if row["values"][CRITERION] is not None]
    kept = [run["horizon"] for run in runs if "horizon" in run]  # earlier versions kept none
    same_horizon = len({json.dumps(horizon) for horizon in kept}) <= 1
    if not same_horizon:
        known = []
    best = min(known, key=lambda row: row["values"][CRITERION]["mean"], default=None)
    name = None
    if best is not None:
        own = [run for run in runs if run["settings"] == best["settings"]]
        own = [run for run in own if _value(run, CRITERION) is not None]
        name = min(own, key=lambda run: run["values"]["model"][CRITERION])["name"]
        best["best"] = True
    baselines: Json = {}
    if runs and same_horizon:
        baselines = {k: v for k, v in runs[0]["values"].items() if k != "model"}
    validations = {json.dumps(run["validation"]) for run in runs}
    return {
        "rows": rows,
        "best": name,
        "baselines": baselines,
        "comparable": len(validations) <= 1 and "null" not in validations,
        "same_horizon": same_horizon,
        "runs": runs,
    }


def results_table(content: Json) -> Table:
    """Return the combinations and the baselines as a table; the best one has an asterisk."""
    columns = score_columns(content["runs"])
    shown = [
        key for key in columns if any(row["values"][key] is not None for row in content["rows"])
    ] or [CRITERION]
    heads = ["", *(columns[key] for key in shown), "runs", "min", "parameters"]
    lines = []
    for row in content["rows"]:
        name = setting_text(row["settings"]) or "all"
        minutes = "-" if row["minutes"] is None else f"{row['minutes']:.1f}"
        mark = " *" if row.get("best") and len(content["rows"]) > 1 else ""
        cells = [_cell(row["values"][key]) for key in shown]
        parameters = "-" if row["parameters"] is None else str(row["parameters"])
        lines.append(Row(name + mark, [*cells, str(len(row["seeds"])), minutes, parameters]))
    for name, values in content["baselines"].items():
        cells = ["-" if values.get(k) is None else f"{values[k]:.3f}" for k in shown]
        lines.append(Row(name, [*cells, "-", "-", "-"], baseline=True))
    return Table(heads, lines)


def gaps(content: Json) -> list[str]:
    """Return why combinations are not complete."""
    found = []
    for row in content["rows"]:
        if row["gap"] is not None:
            name = setting_text(row["settings"])
            found.append(f"{name}: {row['gap']}" if name else row["gap"])
    return found


def remark(content: Json) -> str:
    """Return what the table shows."""
    text = NOTE
    if not content["comparable"]:
        text += " The runs were not all validated on the same recordings."
    if not content["same_horizon"]:
        text += (
            " The runs predict different times ahead, and the error grows with the time: their "
            "scores cannot be compared, and none of them is called the best."
        )
    return text


def write_results(folder: SweepFolder, content: Json) -> None:
    """Write ``result.json``, ``result.md`` and ``result.csv``, a line for each run."""
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"
    write_text(folder.path / "result.json", text)
    parts = ["# Sweep", remark(content), to_markdown(results_table(content))]
    missing = gaps(content)
    if missing:
        parts += ["## Gaps", "\n".join(f"- {text}" for text in missing)]
    write_text(folder.path / "result.md", "\n\n".join(parts) + "\n")
    write_text(folder.path / "result.csv", _csv(content))


def _csv(content: Json) -> str:
    keys = list(dict.fromkeys(key for run in content["runs"] for key in run["settings"]))
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    columns = score_columns(content["runs"])
    writer.writerow([*keys, "seed", *columns, "minutes", "epochs", "steps", "parameters"])
    for run in content["runs"]:
        training = run["training"]
        cells = [run["settings"].get(key, "") for key in keys] + [run["seed"]]
        cells += [_value(run, key) for key in columns]
        cells += [training[key] for key in ("minutes", "epochs", "steps", "parameters")]
        writer.writerow(cells)
    return file.getvalue()


def _value(run: Json, key: str) -> float | None:
    value = run["values"]["model"].get(key)
    return None if value is None else float(value)


def _mean(runs: Sequence[Json], key: str) -> Json | None:
    """Return mean and spread over the runs that have a value, None if none has."""
    given = [value for run in runs if (value := _value(run, key)) is not None]
    if not given:
        return None
    spread = statistics.stdev(given) if len(given) > 1 else None
    return {"mean": statistics.fmean(given), "spread": spread, "runs": len(given)}


def _cell(value: Json | None) -> str:
    if value is None:
        return "-"
    spread = "" if value["spread"] is None else f" ± {value['spread']:.3f}"
    return f"{value['mean']:.3f}{spread}"
