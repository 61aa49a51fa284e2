# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Colours of classes are the page's, and can be told apart without seeing red and green apart."""

import itertools
import json
import re
from pathlib import Path

import numpy as np
import pytest

from mtpgo_training.reports.drawn_bodies import CLASS_COLOURS
from mtpgo_training.view import view_colours
from mtpgo_training.view.view_colours import colour_bytes

PAINTER = Path(view_colours.__file__).parent / "page" / "painter.js"

COMMON = ("car", "van", "truck", "bus", "motorcycle", "bicycle", "pedestrian", "unknown")

DEFICIENCIES = {
    "none": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
}
"""What linear RGB becomes (Machado, Oliveira and Fernandes 2009, severity 1)."""

LEAST_DIFFERENCE = 9.0
"""Least distance of two colours in CIELAB; chosen: three to four times what is just noticeable."""


def theme(name):
    """Return the colours of classes in a theme of the page."""
    text = re.search(rf"{name}: \{{.*?classes: (\{{.*?\}})", PAINTER.read_text("utf-8"), re.DOTALL)
    return json.loads(re.sub(r"(\w+):", r'"\1":', text[1].replace(",\n    }", "\n    }")))


def lab(linear):
    """Return linear RGB in CIELAB (white D65)."""
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    xyz = np.asarray(to_xyz) @ np.clip(linear, 0.0, 1.0) / (0.9505, 1.0, 1.089)
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0)
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


def seen(colour, deficiency):
    """Return in CIELAB how a colour is seen."""
    value = np.array(colour_bytes(colour)) / 255.0
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return lab(np.asarray(DEFICIENCIES[deficiency]) @ linear)


def test_the_light_theme_is_that_of_animations_and_rerun():
    assert theme("light") == {kind.name.lower(): c for kind, c in CLASS_COLOURS.items()}


@pytest.mark.parametrize("name", ["light", "dark"])
@pytest.mark.parametrize("deficiency", DEFICIENCIES)
def test_common_classes_can_be_told_apart(name, deficiency):
    colours = theme(name)
    for one, other in itertools.combinations(COMMON, 2):
        off = seen(colours[one], deficiency) - seen(colours[other], deficiency)
        assert np.linalg.norm(off) > LEAST_DIFFERENCE, (one, other)


def test_the_picture_of_recordings_has_the_same_colours():
    data_picture = pytest.importorskip("mtpgo_training.reports.recordings.data_picture")
    assert data_picture.CLASS_COLOURS == CLASS_COLOURS
