# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page: one HTML file with everything in it, that needs no server and no network."""

from __future__ import annotations

import base64
import html
import re
from pathlib import Path

from mtpgo_training.atomic_files import write_text
from mtpgo_training.view.packed_scene import pack_scene
from mtpgo_training.view.view_scene import ViewScene

_PAGE = Path(__file__).parent / "page"

_SCRIPTS = ("packed_data.js", "timeline.js", "camera.js", "painter.js", "controls.js")
"""In the order in which they use each other."""


def write_page(scene: ViewScene, path: Path) -> None:
    """Write the page of a scene.

    Args:
        scene: what it shows.
        path: the file.

    Raises:
        ConfigurationError: it cannot be written.
    """
    write_text(path, page_text(scene))


def page_text(scene: ViewScene) -> str:
    """Return the page of a scene."""
    parts = {
        "title": html.escape(f"{scene.name}: predictions over time"),
        "style": (_PAGE / "viewer.css").read_text(encoding="utf-8"),
        "script": "\n".join((_PAGE / name).read_text(encoding="utf-8") for name in _SCRIPTS),
        "data": base64.b64encode(pack_scene(scene)).decode(),
    }
    text = (_PAGE / "viewer.html").read_text(encoding="utf-8")
    # In one pass: a name that looks like a part is text.
    return re.sub("{{([a-z]+)}}", lambda found: parts[found[1]], text)
