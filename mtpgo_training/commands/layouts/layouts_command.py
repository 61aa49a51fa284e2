# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo layouts``: write layouts for RViz and Foxglove for a namespace, node name and frame."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from mtpgo_core.displays.display_layouts import (
    FOXGLOVE_FILE,
    RVIZ_FILE,
    DisplayNames,
    layout_texts,
)
from mtpgo_training.atomic_files import write_text
from mtpgo_training.commands.arguments.early_checks import require_folder


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo layouts`` to the command line."""
    parser = subparsers.add_parser(
        "layouts",
        help="write layouts for RViz and Foxglove",
        description="Write layouts for RViz and Foxglove that show a node under its namespace and "
        "name, in the frame of its observations.",
    )
    default = DisplayNames()
    add = parser.add_argument
    add("--namespace", default="", metavar="NAME", help="namespace of the node (default: none)")
    add("--node", default=default.node, metavar="NAME", help="its name (default: %(default)s)")
    add(
        "--frame",
        default=default.frame,
        help="frame of the observations, or the node's fixed_frame (default: %(default)s)",
    )
    add(
        "--objects",
        default=default.objects,
        metavar="TOPIC",
        help="topic of the tracked objects (default: %(default)s, in the namespace)",
    )
    add(
        "--lane-markings",
        default=default.lane_markings,
        metavar="TOPIC",
        help="topic of the lane markings (default: %(default)s, in the namespace)",
    )
    add(
        "--risk",
        default=default.risk,
        metavar="NAME",
        help="name of the node risk, in the same namespace (default: %(default)s)",
    )
    add(
        "-o",
        "--output",
        type=Path,
        default=Path("layouts"),
        metavar="DIR",
        help="folder to write to (default: %(default)s)",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo layouts``."""
    names = DisplayNames(
        namespace=args.namespace,
        node=args.node,
        frame=args.frame,
        objects=args.objects,
        lane_markings=args.lane_markings,
        risk=args.risk,
    )
    require_folder(args.output)
    for name, text in layout_texts(names).items():
        write_text(args.output / name, text)
    print(f"RViz:      rviz2 -d {shlex.quote(str(args.output / RVIZ_FILE))}")
    print(f"Foxglove:  Layouts, Import from file: {args.output / FOXGLOVE_FILE}")
    return 0
