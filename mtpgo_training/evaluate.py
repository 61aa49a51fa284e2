# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo evaluate``: exported models on recordings, by the very path that the node takes.

Protocol ``all``: under the graph policy of the node (``cover`` by default) every agent counts once
an instant. Protocol ``centre``: every agent is predicted in the graph of which it is the centre
(policy ``each``), as the paper evaluates.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from tqdm import tqdm

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.lanes import LaneMap
from mtpgo_core.predictor import PredictorOptions, ScenePredictor
from mtpgo_core.runner import ModelRunner, find_model
from mtpgo_core.schema import Prediction
from mtpgo_core.task import GRAPH_POLICIES
from mtpgo_training.atomic import require_writable, write_text
from mtpgo_training.readers import LAYOUTS, load_recordings
from mtpgo_training.recording import Recording
from mtpgo_training.scorebook import ScoreBook, ScoreTable
from mtpgo_training.scoring import add_scores


def predict_recording(
    runner: ModelRunner, recording: Recording, *, policy: str | None = None, stride_s: float = 0.2
) -> Iterator[Prediction]:
    """The predictions that the node would publish on a recording.

    Args:
        runner: the model.
        recording: every frame is observed.
        policy: graph policy, None for the model's own.
        stride_s: time between two predictions (s).
    """
    predictor = ScenePredictor(
        runner,
        options=PredictorOptions(policy=policy, max_agents=10_000),
        lanes=LaneMap(recording.lanes) if recording.lanes else None,
    )
    stride = max(1, round(stride_s * recording.frame_rate))
    frames = recording.frames.tolist()
    for frame, states in zip(frames, recording.states(), strict=True):
        predictor.observe(states)
        if (frame - frames[0]) % stride == 0:
            yield predictor.predict(states.stamp_ns)


def evaluate(
    runners: dict[str, ModelRunner],
    recordings: Sequence[Recording],
    *,
    policy: str | None = None,
    stride_s: float = 0.2,
    centre: bool = True,
    min_future_s: float = 0.0,
    progress: bool = False,
) -> ScoreTable:
    """Scores of models and baselines over recordings.

    Args:
        runners: models by name. The baselines use the history of the first.
        recordings: what they are scored on.
        policy: graph policy of the protocol ``all``, None for the models' own.
        stride_s: time between two scored instants (s); of the protocol ``centre``, which costs a
            graph an agent, five times as long.
        centre: score the protocol ``centre`` too.
        min_future_s: agents observed for a shorter time afterwards are left out (s).
        progress: show a progress bar.
    """
    book = ScoreBook()
    runs = [("all", policy, stride_s)] + ([("centre", "each", 5.0 * stride_s)] if centre else [])
    total = len(runs) * len(runners) * len(recordings)
    with tqdm(total=total, desc="evaluating", disable=not progress, leave=False) as bar:
        for protocol, chosen, stride in runs:
            for number, (name, runner) in enumerate(runners.items()):
                for recording in recordings:
                    add_scores(
                        book,
                        predict_recording(runner, recording, policy=chosen, stride_s=stride),
                        recording,
                        history=runner.task.history,
                        name=name,
                        protocol=protocol,
                        baselines=number == 0,
                        min_future_s=min_future_s,
                    )
                    bar.update()
    return book.table()


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo evaluate`` to the command line."""
    parser = subparsers.add_parser("evaluate", help="score a model on recordings")
    parser.add_argument(
        "--model", nargs="+", required=True, help="model files or names of shipped models"
    )
    parser.add_argument("--data", type=Path, required=True, help="directory with recordings")
    parser.add_argument("--layout", required=True, help=", ".join(LAYOUTS))
    parser.add_argument("--recordings", nargs="+", help="names of recordings, all by default")
    parser.add_argument(
        "--policy", choices=GRAPH_POLICIES, help="graph policy, the model's own by default"
    )
    parser.add_argument("--stride", type=float, default=0.2, help="time between two instants (s)")
    parser.add_argument(
        "--min-future", type=float, default=0.0, help="leave out agents observed for less (s)"
    )
    parser.add_argument("--no-centre", action="store_true", help="score only all agents")
    parser.add_argument("--json", type=Path, help="write the scores into this file too")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo evaluate``."""
    if not args.stride > 0:
        raise ConfigurationError(f"--stride is {args.stride}, expected more than 0")
    if args.policy == "ego":
        raise ConfigurationError("--policy is 'ego' but a recording has no ego, expected another")
    if args.json is not None:
        require_writable(args.json)
    recordings = load_recordings(args.data, args.layout, args.recordings)
    runners = {}
    for given in args.model:
        runner = ModelRunner.load(find_model(given))
        name = runner.task.name if runner.task.name not in runners else str(given)
        runners[name] = runner
    table = evaluate(
        runners,
        recordings,
        policy=args.policy,
        stride_s=args.stride,
        centre=not args.no_centre,
        min_future_s=args.min_future,
        progress=not args.quiet and sys.stderr.isatty(),
    )
    if args.json is not None:
        report = {
            "models": table.to_dict(),
            "recordings": {r.name: r.sha256 for r in recordings},
            "layout": args.layout,
            "stride_s": args.stride,
            "min_future_s": args.min_future,
            "tasks": {name: dataclasses.asdict(r.task.scene) for name, r in runners.items()},
        }
        write_text(args.json, json.dumps(report, indent=2) + "\n")
    for protocol in ("all", "centre"):
        if any(protocol in scores for scores in table.models.values()):
            title = {"all": "all agents", "centre": "each agent in the centre of its graph"}
            print(f"{title[protocol]}:")
            print(table.text(protocol))
    return 0
