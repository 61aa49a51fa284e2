# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The file in which a live calibration survives a restart: small, versioned, tied to its model."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.live_calibration.live_calibration import LiveCalibration
from mtpgo_core.live_calibration.path_equations import COEFFICIENT_LIMITS, KINDS, PathFit
from mtpgo_core.live_calibration.sigma_tracker import LEVELS, SIGMA_LIMITS
from mtpgo_core.schema import Float64Array
from mtpgo_core.task.calibration import GROUPS
from mtpgo_core.whole_file import read_regular, whole_file

FORMAT = 4
"""Version of the file. In format 1 the factors of the 50 % ellipses were relative to a Gaussian,
now they are relative to the model's file; format 2 had no path correction, and format 3 did not
say what that was learned from."""

KIND = "mtpgo live calibration"

_LARGEST_BYTES = 5_000_000
"""Larger files are not read; a file has some 150 kB, 2 MB with a horizon of 1000 steps."""

_BEGIN_BYTES = 100
"""Within so many bytes a file says its kind (bytes); chosen: its first key is ``kind``."""

_SOURCES = ("model", "constant_velocity")

_PATH_LIMITS = {
    "coefficients": COEFFICIENT_LIMITS,
    "belief": (0.0, 1.0),
    "information": (-1e12, 1e12),
}
"""Smallest and largest value of what is stored of the path correction; those of the last one are
chosen: far beyond what features of at most 100 add up to."""

_LEAST_INFORMATION = 1e-3
"""Least eigenvalue of it; chosen: below any ridge, far above what rounding changes."""


def save(live: LiveCalibration, weights_sha256: str, path: Path) -> None:
    """Write what was learned to a file, atomically.

    Args:
        live: what is written.
        weights_sha256: hash of the model's weights.
        path: the file; its folder exists.

    Raises:
        ConfigurationError: there is a file that is something else.
        OSError: it cannot be written.
    """
    _refuse_other_file(path)
    sigma, paths = np.exp(live.tracker.log_sigma), live.paths.equations.fit
    # Symmetric but for the last bit, which rounding might make a hundredth.
    information = 0.5 * (paths.information + np.swapaxes(paths.information, -1, -2))
    content = {
        "kind": KIND,
        "format": FORMAT,
        "weights_sha256": weights_sha256,
        "levels": list(LEVELS),
        "sigma_factors": {
            source: {
                group: np.round(sigma[index, :, place], 4).tolist()
                for place, group in enumerate(GROUPS)
            }
            for index, source in enumerate(_SOURCES)
        },
        "served_by_constant_velocity": [
            group
            for group, preferred in zip(GROUPS, live.preference.constant_velocity, strict=True)
            if preferred
        ],
        "paths": {
            group: {
                "coefficients": np.round(paths.coefficients[place], 5).tolist(),
                "belief": np.round(paths.belief[place], 4).tolist(),
                "information": np.round(information[place], 2).tolist(),
            }
            for place, group in enumerate(KINDS)
        },
    }
    with whole_file(path, 0o644) as temporary:
        temporary.write_text(json.dumps(content, separators=(",", ":")) + "\n", encoding="utf-8")


def restore(live: LiveCalibration, weights_sha256: str, path: Path) -> bool:
    """Read what was learned from a file.

    Args:
        live: takes it; unchanged after an error.
        weights_sha256: hash of the model's weights.
        path: the file.

    Returns:
        Whether there is such a file.

    Raises:
        ConfigurationError: it cannot be read, is damaged, or is of another model.
    """
    # Not of pathlib, which raises where a folder may not be searched.
    if not os.path.exists(path) and os.path.isdir(path.parent):
        return False
    content = _content(path)
    if content.get("weights_sha256") != weights_sha256:
        raise ConfigurationError(
            f"calibration file {path} is of a model with weights "
            f"{str(content.get('weights_sha256'))[:12]}, expected {weights_sha256[:12]}"
        )
    shape = live.tracker.log_sigma.shape
    try:
        found = content["sigma_factors"]
        if content["levels"] != list(LEVELS):
            raise ValueError("other levels")
        rows = [[found[source][group] for group in GROUPS] for source in _SOURCES]
        sigma = np.array(rows, dtype=np.float64).transpose(0, 2, 1, 3)
        preferred = content["served_by_constant_velocity"]
        unknown = set(preferred) - set(GROUPS)
        read = {name: _of_groups(content["paths"], name) for name in _PATH_LIMITS}
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ConfigurationError(_damaged(path, str(error))) from error
    if sigma.shape != shape:
        raise ConfigurationError(_damaged(path, f"shape {sigma.shape}, expected {shape}"))
    expected = live.paths.equations.fit
    for name, limits in _PATH_LIMITS.items():
        values = read[name]
        if values.shape != getattr(expected, name).shape:
            told = f"{name} of paths with shape {values.shape}"
            raise ConfigurationError(_damaged(path, told))
        if not ((values >= limits[0]) & (values <= limits[1])).all():
            told = f"{name} of paths beyond {limits[0]:g} to {limits[1]:g}"
            raise ConfigurationError(_damaged(path, told))
    if not _are_positive(read["information"]):
        raise ConfigurationError(_damaged(path, "information of paths not positive definite"))
    low, high = SIGMA_LIMITS
    if not ((sigma >= low) & (sigma <= high)).all():
        raise ConfigurationError(_damaged(path, f"factors beyond {low:g} to {high:g}"))
    if unknown:
        raise ConfigurationError(_damaged(path, f"unknown group {min(map(repr, unknown))}"))
    live.tracker.log_sigma = np.log(sigma)
    live.preference.constant_velocity = np.array([group in preferred for group in GROUPS])
    live.paths.equations.begin_with(PathFit.begun(**read))
    return True


def _are_positive(matrices: Float64Array) -> bool:
    """Return whether matrices [..., F, F] are symmetric and positive definite."""
    symmetric = np.array_equal(matrices, np.swapaxes(matrices, -1, -2))
    return symmetric and bool((np.linalg.eigvalsh(matrices) > _LEAST_INFORMATION).all())


def _of_groups(found: dict[str, Any], name: str) -> Float64Array:
    """Return an array of a file, with a row for each kind of road user."""
    return np.array([found[group][name] for group in KINDS], dtype=np.float64)


def _content(path: Path) -> dict[str, Any]:
    """Return the JSON object of a file of this kind and format."""
    try:
        data = read_regular(path, _LARGEST_BYTES)
    except OSError as error:
        raise ConfigurationError(
            f"calibration file {path} cannot be read: {error.strerror}"
        ) from error
    if len(data) > _LARGEST_BYTES:
        raise ConfigurationError(_damaged(path, f"more than {_LARGEST_BYTES} bytes"))
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise ConfigurationError(_damaged(path, str(error))) from error
    if not isinstance(content, dict) or content.get("kind") != KIND:
        raise ConfigurationError(f"{path} is no calibration file, expected one of this node")
    if content.get("format") != FORMAT:
        raise ConfigurationError(
            f"calibration file {path} has format {content.get('format')!r}, expected {FORMAT}"
        )
    return content


def _refuse_other_file(path: Path) -> None:
    """Raise ConfigurationError where a file is neither empty nor begins like one of this kind."""
    if not os.path.isfile(path):
        return
    begin = read_regular(path, _BEGIN_BYTES)
    if begin.strip() and KIND.encode() not in begin:
        raise ConfigurationError(f"{path} is no calibration file and is not overwritten")


def _damaged(path: Path, reason: str) -> str:
    return f"calibration file {path} is damaged: {' '.join(reason.split())[:120]}"
