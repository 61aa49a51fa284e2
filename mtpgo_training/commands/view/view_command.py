# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo view``: road users and their predictions over time."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.commands.arguments.argument_types import positive_number
from mtpgo_training.commands.arguments.data_arguments import add_data_arguments, data_sources
from mtpgo_training.commands.arguments.early_checks import (
    files_of_recordings,
    require_apart,
    require_different,
    require_models,
    require_sources,
)

DESCRIPTION = (
    "Show road users and their predictions over time, of a bag, a recording (--layout) or a live "
    "topic: as one HTML page that needs no server, as an animation, or in the viewer of rerun. "
    "Without an output, the page is written as NAME.html."
)

LONGEST_S = {"html": 60.0, "gif": 8.0, "mp4": 60.0, "rerun": None}
"""Longest time that an output shows if no --end is given (s); chosen: a page of one minute has a
few MB, and an animation for a README less than one."""


def add_parser(subparsers: Any) -> None:
    """Add ``mtpgo view`` to the command line."""
    parser = subparsers.add_parser(
        "view", help="show predictions over time: page, animation, rerun", description=DESCRIPTION
    )
    add = parser.add_argument
    add_data_arguments(parser, "BAG|TOPIC")
    add("--html", type=Path, metavar="FILE", help="write one self-contained page")
    add("--gif", type=Path, metavar="FILE", help="write an animation (extra view)")
    add("--mp4", type=Path, metavar="FILE", help="write a film (extra view)")
    add(
        "--rerun",
        nargs="?",
        type=Path,
        const=Path(),
        metavar="FILE.rrd",
        help="open the viewer of rerun, or write its file (extra view)",
    )
    add(
        "--model",
        metavar="NAME",
        help="name or file of a model that predicts (default: the "
        "predictions in the bag; the model default where there are none)",
    )
    add("--predictions", metavar="TOPIC", help="topic of the predictions")
    add("--start", type=float, metavar="S", help="begin of what is shown (s)")
    add("--end", type=float, metavar="S", help="end of what is shown (s)")
    add("--seconds", type=positive_number, metavar="N", help="how long to listen to a live topic")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo view``."""
    # Imported late: torch takes seconds, which --help does not need.
    from mtpgo_training.view.scene_outputs import prepare_outputs, write_outputs
    from mtpgo_training.view.view_source import ViewOptions, load_scene

    topic = live_topic(args.data_options)
    outputs = {name: getattr(args, name) for name in LONGEST_S if getattr(args, name) is not None}
    limits = [LONGEST_S[name] for name in outputs or ("html",)]
    options = ViewOptions(
        args.model,
        args.predictions,
        args.start,
        args.end,
        None if None in limits else min(limit for limit in limits if limit is not None),
    )
    given = [*args.data_options]
    if not any(name == "layout" for name, _ in given):
        given.append(("layout", "bag"))
    (source,) = data_sources(given)
    if topic is not None:
        from mtpgo_training.view.live_view import view_live

        return view_live(topic, source, options, outputs, args.seconds)
    if args.seconds is not None:
        raise ConfigurationError(
            f"--seconds is given with {source.directory}, expected a live topic: a name with a "
            "leading slash, such as /objects"
        )
    files = [(f"--{name}", path) for name, path in outputs.items() if path != Path()]
    require_different(files)
    models = require_models([] if args.model is None else [args.model])
    require_apart(files, [*models, *files_of_recordings(require_sources([source]))])
    prepare_outputs(outputs)
    scene = load_scene(source, options)
    for sentence in write_outputs(scene, outputs or {"html": Path(f"{scene.name}.html")}):
        print(sentence)
    return 0


def live_topic(given: list[tuple[str, Any]]) -> str | None:
    """Return the topic that is given in place of a bag, None if it is a file or folder.

    A topic has a leading slash, no ending, and is no path that exists; nor is one in a folder that
    does: a bag is looked for there.
    """
    path = next(value for name, value in given if name == "data")
    layout = any(name == "layout" for name, _ in given)
    in_folder = len(path.parts) > 2 and path.parent.is_dir()
    is_topic = path.is_absolute() and not path.suffix and not (path.exists() or in_folder)
    is_topic = is_topic and not layout
    return str(path) if is_topic else None
