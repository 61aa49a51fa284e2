# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo benchmark``: measure the speed of model, node and tools."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from mtpgo_core.task.task_description import GRAPH_POLICIES
from mtpgo_training.benchmark.growth_plan import GrowthPlan
from mtpgo_training.benchmark.measurement.benchmark_model import REFERENCE
from mtpgo_training.benchmark.measurement.machine import command_line
from mtpgo_training.commands.arguments.argument_types import positive_integer, positive_number

Add = Callable[..., Any]

_NO_OPTIONS = ("command", "kind", "run", "words", "json")
"""What the parser and the command line note in the arguments, and where the values are written."""


def add_parser(subparsers: Any) -> None:
    """Add ``mtpgo benchmark`` to the command line."""
    parser = subparsers.add_parser("benchmark", help="measure the speed of model, node and tools")
    kinds = parser.add_subparsers(dest="kind", metavar="KIND", required=True)
    for name, (text, description, arguments, run) in _KINDS.items():
        kind = kinds.add_parser(name, help=text, description=description)
        arguments(kind.add_argument)
        kind.add_argument(
            "--json", type=Path, metavar="OUT", help="also write the values to this file"
        )
        kind.set_defaults(run=run)


def _command(args: argparse.Namespace) -> str:
    """Return the given command line without the options that do not affect the result."""
    given = {k: v for k, v in vars(args).items() if k not in _NO_OPTIONS}
    return command_line(args.kind, given)


def _latency_arguments(add: Add) -> None:
    count = partial(add, type=positive_integer, metavar="N")
    count("--agents", nargs="+", default=[2, 8, 16, 32, 64, 128])
    count("--threads", nargs="+", default=[1])
    add("--seconds", type=positive_number, default=12.0, help="time per row (12)")


def run_latency(args: argparse.Namespace) -> int:
    """Run ``mtpgo benchmark latency``."""
    # Imported late, here and below: loading torch takes about a second.
    from mtpgo_training.benchmark.latency_benchmark import print_latency

    print_latency(args.agents, args.threads, args.seconds, args.json, _command(args))
    return 0


def _node_arguments(add: Add) -> None:
    count, rate = partial(add, type=positive_integer), partial(add, type=positive_number)
    count("--agents", nargs="+", default=[64], metavar="N", help="road users (64)")
    add("--graph", choices=GRAPH_POLICIES, default="scene", help="policy (scene)")
    count("--neighbours", metavar="K", help="most besides a graph's centre; as trained")
    rate("--rate", default=5.0, metavar="HZ", help="predictions (5)")
    rate("--input-rate", default=25.0, metavar="HZ", help="observations (25)")
    _duration(add, 60.0)
    add("--markers", action="store_true", help="also subscribe to the markers")
    _model(add)
    add(
        "-p",
        "--parameters",
        action="extend",
        nargs="+",
        default=[],
        metavar="NAME:=VALUE",
        help="of the node",
    )
    add(
        "--bars",
        action="store_true",
        help="measure every requirement instead, status 1 if one does not hold; of the other "
        "options only --duration, --model and --json apply",
    )


def run_node(args: argparse.Namespace) -> int:
    """Run ``mtpgo benchmark node``; with ``--bars`` return 1 if a requirement does not hold."""
    from mtpgo_training.benchmark import node_benchmark as node
    from mtpgo_training.benchmark.node_case import NodeCase

    if args.bars:
        given = {"bars": True, "duration": args.duration, "model": args.model}
        command = command_line(args.kind, given)
        return 0 if node.print_requirements(args.duration, args.model, command, args.json) else 1
    cases = [
        NodeCase(
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
    count = partial(add, type=positive_integer)
    policies = [policy for policy in GRAPH_POLICIES if policy != "ego"]
    add("--graph", nargs="+", choices=GRAPH_POLICIES, default=policies, help="policies")
    count("--neighbours", metavar="K", help="most besides a graph's centre; as trained")
    add("--rate", type=positive_number, default=5.0, metavar="HZ", help="predictions (5)")
    _duration(add, 20.0)
    count("--step", default=8, metavar="N", help="sizes are multiples of this (8)")
    count("--most", default=512, metavar="N", help="the largest size tried (512)")
    _model(add)


def run_largest(args: argparse.Namespace) -> int:
    """Run ``mtpgo benchmark largest``."""
    from mtpgo_training.benchmark.node_benchmark import print_largest
    from mtpgo_training.benchmark.node_case import NodeCase

    case = NodeCase(0, rate=args.rate, duration_s=args.duration, neighbours=args.neighbours)
    print_largest(
        args.graph, case, args.model, _command(args), args.json, step=args.step, most=args.most
    )
    return 0


def _growth_arguments(add: Add) -> None:
    plan = GrowthPlan()
    count = partial(add, type=positive_integer, metavar="N")
    rate = partial(add, type=positive_number, metavar="HZ")
    count("--agents", nargs="+", default=list(plan.agents))
    add("--graph", choices=GRAPH_POLICIES, default=plan.graph, help="policy (cover)")
    count("--input-agents", default=plan.input_agents, help="objects in each input message (128)")
    rate("--input-rates", nargs="+", default=list(plan.input_rates))
    _duration(add, plan.seconds)
    _model(add)
    add("--without-node", action="store_true", help="measure only what needs no ROS")


def run_growth(args: argparse.Namespace) -> int:
    """Run ``mtpgo benchmark growth``."""
    from mtpgo_training.benchmark.growth_benchmark import print_growth

    plan = GrowthPlan(
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
    minutes = partial(add, type=positive_number, metavar="MIN")
    add("--data", type=Path, metavar="DIR", help="recordings; by default one is simulated")
    add("--layout", default="highd", help="layout of --data (highd)")
    minutes("--minutes", default=20.0, help="length of the simulated recording (20)")


def run_conversion(args: argparse.Namespace) -> int:
    """Run ``mtpgo benchmark conversion``."""
    from mtpgo_training.benchmark.conversion_benchmark import print_conversion

    given = {"data": args.data, "layout": args.layout}
    if args.data is not None:
        from mtpgo_training.commands.arguments.early_checks import require_sources
        from mtpgo_training.data.data_sources import DataSource

        require_sources([DataSource(args.data, args.layout)])
    if args.data is None:
        given = {"minutes": args.minutes}
    command = command_line(args.kind, given)
    print_conversion(args.data, args.layout, args.minutes, command, args.json)
    return 0


def _trails_arguments(add: Add) -> None:
    count = partial(add, type=positive_integer, metavar="N")
    count("--agents", nargs="+", default=[16, 64, 128])
    count("--rounds", default=100, help="cycles of each row (100)")


def run_trails(args: argparse.Namespace) -> int:
    """Run ``mtpgo benchmark trails``."""
    from mtpgo_training.benchmark.trail_benchmark import print_trails

    print_trails(args.agents, args.rounds, _command(args), args.json)
    return 0


def _training_arguments(add: Add) -> None:
    count = partial(add, type=positive_integer, metavar="N")
    count("--scenes", default=128, help="graphs in a batch (128)")
    count("--threads", default=2, help="threads in total (2)")
    count("--rounds", default=7, help="steps of each implementation (7)")


def run_training(args: argparse.Namespace) -> int:
    """Run ``mtpgo benchmark training``."""
    from mtpgo_training.benchmark.training_benchmark import print_training

    print_training(args.scenes, args.threads, args.rounds, _command(args), args.json)
    return 0


def _duration(add: Add, default: float) -> None:
    text = f"time of each measurement ({default:g})"
    add("--duration", type=positive_number, default=default, metavar="S", help=text)


def _model(add: Add) -> None:
    text = (
        "name or file of a model; 'reference' is the default architecture (hidden 64, RK4), "
        "untrained (reference)"
    )
    add("--model", default=REFERENCE, metavar="NAME|FILE", help=text)


_Kind = tuple[str, str, Callable[[Add], None], Callable[[argparse.Namespace], int]]

_KINDS: dict[str, _Kind] = {
    "latency": (
        "one prediction against the number of agents",
        "Time the exported model on one complete graph, alternating with a straightforward "
        "implementation of the same equations on the same weights.",
        _latency_arguments,
        run_latency,
    ),
    "node": (
        "the real node on one core, from message to message",
        "Start the predictor, bound to one core, and a load generator, and measure the time from "
        "the publication of an observation to the receipt of its prediction. Traffic drives on a "
        "ring road at the density of a busy motorway.",
        _node_arguments,
        run_node,
    ),
    "largest": (
        "the largest scene that the node can handle",
        "Search, for each graph policy, the largest scene in which no prediction is late or by "
        "constant velocity.",
        _largest_arguments,
        run_largest,
    ),
    "growth": (
        "time against the number of agents and the input's rate",
        "Measure how the time grows with the number of road users, without ROS and through the "
        "node, and the cost of the input at several rates and of markers.",
        _growth_arguments,
        run_growth,
    ),
    "trails": (
        "the memory of trails, when it is full",
        "Measure the processor time per cycle that models with trails need to ask and to extend "
        "a full memory of a junction, and its size.",
        _trails_arguments,
        run_trails,
    ),
    "training": (
        "a training step",
        "Time training steps, alternating with a straightforward implementation of the same "
        "equations on the same weights, and compare the memory they need.",
        _training_arguments,
        run_training,
    ),
    "conversion": (
        "converting recordings into bags and into the training cache",
        "Measure how many times faster than real time recordings are converted, and prepared for "
        "training, on one core.",
        _conversion_arguments,
        run_conversion,
    ),
}
"""Name -> help, description, function that adds the arguments, and function that runs it."""
