# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The results of an evaluation as plain data for JSON, and as text for the terminal."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Mapping
from typing import Any

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_training.evaluation.bag_evaluation import BagResult
from mtpgo_training.evaluation.details import details, over_groups, seed_groups
from mtpgo_training.evaluation.scorebook import columns
from mtpgo_training.evaluation.training_overlap import seen_by, warnings_of
from mtpgo_training.scenes.kinematic_baselines import BASELINES

Json = dict[str, Any]

HEADINGS = {"all": "all agents", "centre": "each agent in the centre of its graph"}
"""What the protocols are called, in the order in which they are shown."""

ONE_RECORDING = (
    "no intervals over recordings can be given for a single recording: its road users share its "
    "traffic"
)


def describe(
    result: BagResult, runners: Mapping[str, ModelRunner], args: argparse.Namespace
) -> Json:
    """The content of ``--json``, from which the tables and the report are made."""
    evaluation = result.evaluation
    models = evaluation.book.table().to_dict()
    seen = seen_by({n: r.task.training for n, r in runners.items()}, evaluation.recordings)
    groups = seed_groups(list(runners), args.seeds and len(runners) > 1)
    single = len(evaluation.recordings) < 2
    return {
        "models": models,
        **details(evaluation.book),
        "seeds": over_groups(models, groups),
        "agreement": {
            bag: {model: found.to_dict() for model, found in found_by.items()}
            for bag, found_by in result.agreements.items()
        },
        "recordings": evaluation.recordings,
        "seen": seen,
        "warnings": [*warnings_of(seen), *result.warnings],
        "notes": [ONE_RECORDING] if single else [],
        "layout": sorted({str(v) for key, v in args.data_options if key == "layout"}),
        "stride_s": None if args.predictions else args.stride,
        "min_future_s": args.min_future,
        "policy": args.policy,
        "one_sample": args.one_sample,
        "baselines": list(BASELINES),
        "tasks": {name: dataclasses.asdict(r.task.scene) for name, r in runners.items()},
        "weights": {name: r.task.weights_sha256 for name, r in runners.items()},
    }


def print_result(content: Json, result: BagResult) -> None:
    """The tables for the terminal."""
    table = result.evaluation.book.table()
    for protocol, heading in HEADINGS.items():
        if any(protocol in scores for scores in content["models"].values()):
            print(f"{heading}:")
            print(table.text(protocol))
            print()
            if not content["notes"]:
                print(f"{interval_text(content, protocol)}\n")
    if any("all" in found for found in content["by_manoeuvre"].values()):
        print(f"{manoeuvre_text(content)}\n")
        print(f"{nees_text(content)}\n")
    for group, row in content["seeds"].items():
        print(seeds_text(group, row))
    for bag, found in result.agreements.items():
        for model, agreement in found.items():
            print(agreement.text(bag, model))
    for note in content["notes"]:
        print(f"Note: {note}.")


def interval_text(content: Json, protocol: str) -> str:
    """The intervals over recordings of the most important values."""
    keys = {"ade": "ADE m", "fde": "FDE m", "anll": "ANLL", "coverage_90": "in 90%"}
    rows = [["95 % interval", *keys.values(), "ADE / cv"]]
    for model, protocols in content["intervals"].items():
        if protocol in protocols:
            relative = content["relative"][model].get(protocol, {}).get("ade")
            share = [None, None] if relative is None else [relative["low"], relative["high"]]
            ends = [protocols[protocol][key] for key in keys] + [share]
            rows.append([model, *(_span(*end) for end in ends)])
    return columns(rows)


def manoeuvre_text(content: Json) -> str:
    """ADE by manoeuvre of all agents that were observed for the whole horizon."""
    found = {m: p["all"] for m, p in content["by_manoeuvre"].items() if "all" in p}
    names = list(dict.fromkeys(name for rows in found.values() for name in rows))
    counts = {name: max(r[name]["n"] for r in found.values() if name in r) for name in names}
    rows = [["ADE m", *(f"{name.replace('_', ' ')} ({counts[name]})" for name in names)]]
    rows += [
        [model, *(f"{r[name]['ade']:.3f}" if name in r else "-" for name in names)]
        for model, r in found.items()
    ]
    return columns(rows)


def nees_text(content: Json) -> str:
    """NEES of all agents at a few times, of the heaviest mode and of the whole mixture."""
    found = {m: p["all"] for m, p in content["by_horizon"].items() if "all" in p}
    found = {m: row for m, row in found.items() if any(v is not None for v in row["nees"])}
    steps = max((len(row["nees"]) for row in found.values()), default=0)
    shown = sorted({max(0, round(steps * part) - 1) for part in (0.2, 0.6, 1.0)}) if steps else []
    times: list[float | None] = max((row["time_s"] for row in found.values()), key=len, default=[])
    heads = [f"step {k + 1}" if times[k] is None else f"{times[k]:g} s" for k in shown]
    rows = [["NEES (mixture), 2 is right", *heads]]
    for model, row in found.items():
        pairs = zip(row["nees"], row["nees_mixture"], strict=True)
        cells = ["-" if a is None else f"{a:.2f} ({b:.2f})" for a, b in pairs]
        rows.append([model, *(cells[k] if k < len(cells) else "-" for k in shown)])
    return columns(rows)


def seeds_text(group: str, row: Json) -> str:
    """Mean and interval over the seeds of one recipe."""
    lines = []
    for protocol in HEADINGS:
        if protocol in row:
            parts = [
                f"{key} {v['mean']:.3f} ({_span(v['low'], v['high'])})"
                for key, v in row[protocol].items()
                if key in ("ade", "fde", "anll", "coverage_90")
            ]
            lines.append(f"{group}, {len(row['models'])} seeds, {protocol}: {', '.join(parts)}")
    return "\n".join(lines)


def _span(low: float | None, high: float | None) -> str:
    return "-" if low is None or high is None else f"{low:.3f}..{high:.3f}"
