# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page of a report, which contains its figures, and that of an evaluation."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2

from mtpgo_core.errors import ConfigurationError, found_names
from mtpgo_training.atomic_files import write_text
from mtpgo_training.evaluation.extreme_scenes import ExtremeScenes
from mtpgo_training.reports.figures import draw_figures
from mtpgo_training.reports.honesty.honesty_tables import honesty_tables, split_tables
from mtpgo_training.reports.honesty.live_scores import live_tables
from mtpgo_training.reports.scene_plot import draw_picture
from mtpgo_training.reports.series import series_names
from mtpgo_training.reports.tables import agreement_table, group_tables, result_tables
from mtpgo_training.scenes.tracker.tracker_config import SIMULATED
from mtpgo_training.table_format import Table, to_html

Json = dict[str, Any]

PAGE_NAME = "index.html"
TEMPLATE_NAME = "page.html.j2"

SCENES = 3
"""Panels of each picture of scenes."""


def prepare_folder(folder: Path) -> None:
    """Create the folder and check that it can be written, before long work.

    Raises:
        ConfigurationError: it cannot.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except FileExistsError as error:
        raise ConfigurationError(f"--report {folder} is a file, expected a folder") from error
    except OSError as error:
        raise ConfigurationError(
            f"--report {folder} cannot be written: {error.strerror}"
        ) from error


def write_report(folder: Path, content: Json, scenes: Mapping[str, ExtremeScenes]) -> Path:
    """Write the page, and its figures as PNG into the same folder.

    Args:
        folder: where to, see :func:`prepare_folder`.
        content: of ``mtpgo evaluate --json``.
        scenes: by model.

    Returns:
        The page.
    """
    figures = draw_figures(content, folder)
    models = series_names(content, baselines=False)
    page = folder / PAGE_NAME
    render_page(
        page,
        title=f"Evaluation of {', '.join(models)}",
        subtitle=_subtitle(content),
        warnings=content["warnings"],
        notes=content["notes"],
        tables=[*result_tables(content), *honesty_tables(content), *live_tables(content)],
        folded=split_tables(content),
        agreement=agreement_table(content),
        figures={name: path for name, path in figures.items() if name != "manoeuvres"},
        wide={name: path for name, path in figures.items() if name == "manoeuvres"},
        groups=group_tables(content),
        scenes=_scenes(folder, scenes),
        facts=_facts(content),
    )
    return page


def render_page(
    page: Path,
    *,
    title: str,
    subtitle: str,
    tables: Sequence[Table],
    figures: Mapping[str, Path],
    facts: Sequence[tuple[str, str]],
    scenes: Sequence[Mapping[str, str]] = (),
    wide: Mapping[str, Path] | None = None,
    groups: Sequence[Table] = (),
    folded: Sequence[Table] = (),
    agreement: Table | None = None,
    warnings: Sequence[str] = (),
    notes: Sequence[str] = (),
) -> None:
    """Write a page, whose figures become part of it.

    Args:
        page: the file.
        title: over everything.
        subtitle: below it.
        tables: with headings, shown first.
        figures: PNG files by the names that the template has captions for, side by side.
        facts: names and values, shown last.
        scenes: pictures of the best and worst scenes: ``heading``, ``alt`` and ``data``.
        wide: figures of the whole width.
        groups: tables by group, after the figures.
        folded: details with headings, which a reader opens one by one.
        agreement: of recorded and offline predictions.
        warnings: why this is no clean test.
        notes: what else a reader should know.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["table"] = to_html
    text = environment.get_template(TEMPLATE_NAME).render(
        title=title,
        subtitle=subtitle,
        warnings=warnings,
        notes=notes,
        tables=tables,
        agreement=agreement,
        figures=[_figure(name, path) for name, path in figures.items()],
        wide=[_figure(name, path) for name, path in (wide or {}).items()],
        groups=groups,
        folded=folded,
        scenes=scenes,
        facts=facts,
    )
    write_text(page, text)


def _figure(name: str, path: Path) -> dict[str, str]:
    return {"name": name, "data": _embedded(path)}


def _embedded(path: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode()


def _scenes(folder: Path, scenes: Mapping[str, ExtremeScenes]) -> list[dict[str, str]]:
    found = []
    for model, extremes in scenes.items():
        for kind, moments in (("best", extremes.best(SCENES)), ("worst", extremes.worst(SCENES))):
            if not moments:
                continue
            path = folder / f"{kind}_{_file_name(model)}.png"
            draw_picture(moments, path)
            heading = f"{model}: {kind}"
            found.append({"heading": heading, "alt": heading, "data": _embedded(path)})
    return found


def _file_name(model: str) -> str:
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in model)


def _subtitle(content: Json) -> str:
    names = list(content["recordings"])
    shown = found_names(names, 12, none="")
    return f"On {len(names)} recording{'s' if len(names) != 1 else ''}: {shown}."


def _facts(content: Json) -> list[tuple[str, str]]:
    facts = []
    for name, sha256 in content["weights"].items():
        scene = content["tasks"][name]
        facts.append(
            (
                name,
                f"weights {sha256[:16]}, policy {content['policy'] or scene['policy']}, up to "
                f"{scene['max_neighbours']} neighbours within {scene['radius_m']:g} m",
            )
        )
    stride = content["stride_s"]
    facts += [
        ("layout", ", ".join(content["layout"]) or "the bag's own observations"),
        ("instants", "those of the bag" if stride is None else f"every {stride:g} s"),
        ("least future", f"{content['min_future_s']:g} s"),
    ]
    if content.get("trails") is False:
        facts.append(("trails", "no earlier road user was known"))
    if content.get("lanes") is False:
        facts.append(("lanes", "hidden from models with scene.lane_ways"))
    if content["one_sample"]:
        facts.append(("past", "forgotten before each instant: each road user has one sample"))
    if content.get("calibration") is not None:  # results from before it could be chosen lack it
        facts.append(("calibration", f"{content['calibration']}, prefer {content['prefer']}"))
    if content.get("path_smoothing_s"):
        facts.append(("paths", f"smoothed with a memory of {content['path_smoothing_s']:g} s"))
    if content["tracker"] == SIMULATED:
        facts.append(("observations", f"of a simulated tracker, seed {content['tracker_seed']}"))
    if content.get("unknown_classes"):
        facts.append(("classes", "every road user was observed as one of an unknown class"))
    facts += [(f"recording {n}", f"SHA-256 {h[:16]}") for n, h in content["recordings"].items()]
    return facts
