# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The outputs of a scene by name; each imports its libraries when it is used."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from pathlib import Path

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import require_suffix, require_writable
from mtpgo_training.view.view_scene import ViewScene

MODULES = {"html": (), "gif": ("matplotlib", "PIL"), "mp4": ("matplotlib",), "rerun": ("rerun",)}
"""Output -> modules of the extra `view` that it needs."""


_GIF_SUFFIXES = (".gif", ".webp")
"""What ``gif`` writes, by the name of the file."""


def prepare_outputs(outputs: Mapping[str, Path]) -> None:
    """Check that outputs can be written, before long work.

    Args:
        outputs: name -> file; for ``rerun`` an empty path opens its viewer.

    Raises:
        ConfigurationError: a library is not installed, or a file cannot be written or is named as
            another kind of file.
    """
    for name, path in outputs.items():
        for module in MODULES[name]:
            require_extra(module, f"--{name}")
        if name == "gif":
            require_suffix("--gif", path, _GIF_SUFFIXES)
        if path != Path():
            require_writable(path)
    if "mp4" in outputs:
        from mtpgo_training.view.animation_files import ffmpeg_path

        ffmpeg_path()


def require_extra(module: str, purpose: str) -> None:
    """Check that a library of the extra `view` can be imported.

    Args:
        module: its top-level module.
        purpose: the option that needs it, for the error.

    Raises:
        ConfigurationError: it is not installed.
    """
    try:
        importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise ConfigurationError(
            f"{purpose} needs {error.name}, which comes with the extra 'view': "
            "pip install 'mtpgo_ros[view]'"
        ) from error


def write_outputs(scene: ViewScene, outputs: Mapping[str, Path]) -> Iterator[str]:
    """Write the outputs and yield a sentence on each.

    Args:
        scene: what is shown.
        outputs: see :func:`prepare_outputs`.

    Raises:
        ConfigurationError: an output cannot be written.
    """
    shown = (
        f"{scene.recording.duration_s:.1f} s, {len(scene.recording.track_id)} road users, "
        f"{len(scene.predictions)} predictions"
    )
    for name, path in outputs.items():
        if name == "html":
            from mtpgo_training.view.html_page import write_page

            write_page(scene, path)
        elif name == "rerun":
            from mtpgo_training.view.rerun_scene import log_scene

            log_scene(scene, path if path != Path() else None)
            if path == Path():
                yield f"the viewer of rerun shows {scene.name}: {shown}"
                continue
        else:
            from mtpgo_training.view.animation_files import write_animation

            write_animation(scene, path, name)
        yield f"{path}: {scene.name}, {shown}, {path.stat().st_size / 1e6:.2f} MB"
