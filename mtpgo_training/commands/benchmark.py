# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command line of ``mtpgo benchmark``."""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.task.task_description import GRAPH_POLICIES
from mtpgo_training.benchmark.benchmark_model import REFERENCE
from mtpgo_training.benchmark.machine import command_line

Add = Callable[..., Any]


def add_parser(subparsers: Any) -> None:
    """Register ``mtpgo benchmark``."""
    parser = subparsers.add_parser("benchmark", help="measure the speed of model, node and tools")
    kinds = parser.add_subparsers(dest="kind", metavar="KIND", required=True)
    for name, (text, description, arguments, run) in _KINDS.items():
        kind = kinds.add_parser(name, help=text, description=description)
        arguments(kind.add_argument)
        kind.add_argument("--json", type=Path, metavar="OUT", help="write the figures there")
        kind.set_defaults(run=run)


def _command(args: argparse.Namespace) -> str:
    """The command line that was given, less what does not matter for the figures."""
    given = {k: v for k, v in vars(args).items() if k not in ("command", "kind", "run", "json")}
    return command_line(args.kind, given)


def _latency_arguments(add: Add) -> None:
    add("--agents", nargs="+", type=_count, default=[2, 8, 16, 32, 64, 128], metavar="N")
    add("--threads", nargs="+", type=_count, default=[1], metavar="N")
    add("--seconds", type=float, default=12.0, help="time per row (12)")


def run_latency(args: argparse.Namespace) -> int:
    """Run ``mtpgo benchmark latency``.

    Raises:
        ConfigurationError: a duration that is not positive.
    """
    if not args.seconds > 0.0:
        raise ConfigurationError(f"--seconds is {args.seconds}, expected a positive number")
    # Only here, and likewise below: torch takes a second to load.
    from mtpgo_training.benchmark.latency_benchmark import print_latency

    print_latency(args.agents, args.threads, args.seconds, args.json, _command(args))
    return 0


def _node_arguments(add: Add) -> None:
    add("--agents", nargs="+", type=_count, default=[64], metavar="N", help="road users (64)")
    add("--graph", choices=GRAPH_POLICIES, default="scene", help="policy (scene)")
    add("--neighbours", type=_count, metavar="K", help="of a graph's centre; as trained")
    add("--rate", type=_positive, default=5.0, metavar="HZ", help="predictions (5)")
    add("--input-rate", type=_positive, default=25.0, metavar="HZ", help="observations (25)")
    _duration(add, 60.0)
    add("--markers", action="store_true", help="somebody listens to the markers, too")
    _model(add)
    add("-p", "--parameters", nargs="+", default=[], metavar="NAME:=VALUE", help="of the node")
    add(
        "--bars",
        action="store_true",
        help="measure all that is asked for instead, status 1 if something does not hold; only "
        "--duration, --model and --json count then",
    )


def run_node(args: argparse.Namespace) -> int:
    """Run ``mtpgo benchmark node``; 1 if ``--bars`` finds one that does not hold."""
    from mtpgo_training.benchmark import node_benchmark as node
    from mtpgo_training.benchmark.node_case import Case

    if args.bars:
        wanted = {"bars": True, "duration": args.duration, "model": args.model}
        command = command_line(args.kind, wanted)
        return 0 if node.print_bars(args.duration, args.model, command, args.json) else 1
    cases = [
        Case(
            agents,
            args.graph,
            args.rate,
            args.input_rate,
            args.duration,
            args.neighbours,
            args.markers,
        )
        for agents in args.agents
    ]
    node.print_node(cases, args.model, _command(args), args.json, args.parameters)
    return 0


def _largest_arguments(add: Add) -> None:
    policies = [policy for policy in GRAPH_POLICIES if policy != "ego"]
    add("--graph", nargs="+", choices=GRAPH_POLICIES, default=policies, help="policies")
    add("--neighbours", type=_count, metavar="K", help="of a graph's centre; as trained")
    add("--rate", type=_positive, default=5.0, metavar="HZ", help="predictions (5)")
    _duration(add, 20.0)
    add("--step", type=_count, default=8, metavar="N", help="sizes are multiples of this (8)")
    add("--most", type=_count, default=512, metavar="N", help="the largest size tried (512)")
    _model(add)


def run_largest(args: argparse.Namespace) -> int:
    """Run ``mtpgo benchmark largest``."""
    from mtpgo_training.benchmark.node_benchmark import print_largest
    from mtpgo_training.benchmark.node_case import Case

    case = Case(0, rate=args.rate, duration_s=args.duration, neighbours=args.neighbours)
    print_largest(
        args.graph, case, args.model, _command(args), args.json, step=args.step, most=args.most
    )
    return 0


def _growth_arguments(add: Add) -> None:
    add("--agents", nargs="+", type=_count, default=[8, 16, 32, 64, 128, 256, 512], metavar="N")
    add("--graph", choices=GRAPH_POLICIES, default="cover", help="policy (cover)")
    add("--input-agents", type=_count, default=128, metavar="N", help="of the input table (128)")
    add(
        "--input-rates",
        nargs="+",
        type=_positive,
        default=[5.0, 10.0, 25.0, 50.0, 100.0],
        metavar="HZ",
    )
    _duration(add, 10.0)
    _model(add)
    add("--without-node", action="store_true", help="only what needs no ROS")


def run_growth(args: argparse.Namespace) -> int:
    """Run ``mtpgo benchmark growth``."""
    from mtpgo_training.benchmark.growth_benchmark import GrowthPlan, print_growth

    plan = dataclasses.replace(
        GrowthPlan(),
        agents=tuple(args.agents),
        graph=args.graph,
        input_rates=tuple(args.input_rates),
        input_agents=args.input_agents,
        seconds=args.duration,
        with_node=not args.without_node,
    )
    print_growth(plan, args.model, _command(args), args.json)
    return 0


def _conversion_arguments(add: Add) -> None:
    add("--data", type=Path, metavar="DIR", help="recordings; by default one is simulated")
    add("--layout", default="highd", help="of --data (highd)")
    add("--minutes", type=_positive, default=20.0, metavar="MIN", help="to be simulated (20)")


def run_conversion(args: argparse.Namespace) -> int:
    """Run ``mtpgo benchmark conversion``."""
    from mtpgo_training.benchmark.conversion_benchmark import print_conversion

    made = {"minutes": args.minutes}
    given = made if args.data is None else {"data": args.data, "layout": args.layout}
    command = command_line(args.kind, given)
    print_conversion(args.data, args.layout, args.minutes, command, args.json)
    return 0


def _training_arguments(add: Add) -> None:
    add("--scenes", type=_count, default=128, metavar="N", help="graphs in a batch (128)")
    add("--threads", type=_count, default=2, metavar="N", help="in all (2)")
    add("--rounds", type=_count, default=7, metavar="N", help="steps of each (7)")


def run_training(args: argparse.Namespace) -> int:
    """Run ``mtpgo benchmark training``."""
    from mtpgo_training.benchmark.training_benchmark import print_training

    print_training(args.scenes, args.threads, args.rounds, _command(args), args.json)
    return 0


def _duration(add: Add, default: float) -> None:
    text = f"time of each measurement ({default:g})"
    add("--duration", type=_positive, default=default, metavar="S", help=text)


def _model(add: Add) -> None:
    text = (
        "name or file of a model; 'reference' is the default architecture (hidden 64, RK4), not "
        "trained (reference)"
    )
    add("--model", default=REFERENCE, metavar="NAME|FILE", help=text)


def _count(text: str) -> int:
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} is given, expected at least 1")
    return number


def _positive(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is given, expected a number above 0")
    return number


_Kind = tuple[str, str, Callable[[Add], None], Callable[[argparse.Namespace], int]]

_KINDS: dict[str, _Kind] = {
    "latency": (
        "one prediction against the number of agents",
        "Time the exported model on one complete graph, in turns with a straightforward "
        "implementation of the same equations on the same weights.",
        _latency_arguments,
        run_latency,
    ),
    "node": (
        "the real node on one core, from message to message",
        "Start the predictor, bound to one core, and a load generator, and measure from the "
        "publication of an observation to the receipt of its prediction. Traffic drives on a ring "
        "road at the density of a busy motorway.",
        _node_arguments,
        run_node,
    ),
    "largest": (
        "the largest scene that the node carries",
        "Search for the largest scene in which no prediction is late or left to constant "
        "velocity, for each graph policy.",
        _largest_arguments,
        run_largest,
    ),
    "growth": (
        "time against the number of agents and the input's rate",
        "Measure how time grows with the road users, without ROS and through the node, what the "
        "input costs at several rates, and what markers cost.",
        _growth_arguments,
        run_growth,
    ),
    "training": (
        "a step of training",
        "Time training steps in turns with a straightforward implementation of the same "
        "equations on the same weights, and compare the memory they need.",
        _training_arguments,
        run_training,
    ),
    "conversion": (
        "recordings into bags and into the training's cache",
        "Measure on one core how many times faster than real time recordings are converted and "
        "made ready for training.",
        _conversion_arguments,
        run_conversion,
    ),
}
"""Name, help, description, arguments and function of every kind."""
