# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Animations as files: GIF and WebP by Pillow, MP4 by ffmpeg."""

from __future__ import annotations

import itertools
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import replacing
from mtpgo_training.view.scene_frames import ScenePainter
from mtpgo_training.view.view_scene import ViewScene

WIDTH = {"gif": 800, "mp4": 1280}
"""Width by kind (pixels); chosen: a GIF of a page's width, a film of a screen's."""

COLOURS = 64
"""Colours of a GIF; chosen: with more, files grow and pictures look the same."""

WEBP_QUALITY = 60
"""Quality of a WebP, of 100; chosen: lines stay clean."""

Picture = NDArray[np.uint8]


def write_animation(scene: ViewScene, path: Path, kind: str) -> None:
    """Write a scene as an animation.

    Args:
        scene: what it shows.
        path: the file; a ``gif`` that ends in ``.webp`` becomes a WebP.
        kind: ``gif`` or ``mp4``.

    Raises:
        ConfigurationError: it cannot be written, or there is no ffmpeg.
    """
    painter = ScenePainter(scene, WIDTH[kind])
    times_s = painter.times_s
    period_s = float(np.median(np.diff(times_s))) if len(times_s) > 1 else 0.1
    with replacing(path) as temporary:
        if kind == "gif":
            write = _write_webp if path.suffix.lower() == ".webp" else _write_gif
            write(painter.pictures(), temporary, period_s)
        else:
            _write_film(painter.pictures(), temporary, period_s)


def _write_gif(pictures: Iterator[Picture], path: Path, period_s: float) -> None:
    """Write a GIF whose pictures have the colours of the middle one."""
    from PIL import Image

    images = [Image.fromarray(picture) for picture in pictures]
    palette = images[len(images) // 2].quantize(COLOURS, method=Image.Quantize.MEDIANCUT)
    flat = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    _save(flat, path, period_s, format="GIF", optimize=False)


def _write_webp(pictures: Iterator[Picture], path: Path, period_s: float) -> None:
    """Write an animated WebP, a third of the size of a GIF."""
    from PIL import Image

    images = [Image.fromarray(picture) for picture in pictures]
    _save(images, path, period_s, format="WEBP", quality=WEBP_QUALITY, method=4)


def _save(images: Sequence[Any], path: Path, period_s: float, **how: Any) -> None:
    """Write images of Pillow as an animation that repeats."""
    duration_ms = round(1000 * period_s)
    images[0].save(
        path, save_all=True, append_images=images[1:], duration=duration_ms, loop=0, **how
    )


def ffmpeg_path() -> str:
    """Return the path of ffmpeg: the one of the system, else that of imageio-ffmpeg.

    Raises:
        ConfigurationError: there is none.
    """
    found = shutil.which("ffmpeg")
    if found is not None:
        return found
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ModuleNotFoundError, RuntimeError) as error:
        raise ConfigurationError(
            "--mp4 needs ffmpeg, which comes with the extra 'view': pip install 'mtpgo_ros[view]'"
        ) from error


def _write_film(pictures: Iterable[Picture], path: Path, period_s: float) -> None:
    """Give the pictures to ffmpeg, one after the other."""
    iterator = iter(pictures)
    first = next(iterator)
    height, width = first.shape[:2]
    command = [
        *(ffmpeg_path(), "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"),
        *("-s", f"{width}x{height}", "-r", f"{1.0 / period_s:.6f}", "-i", "-"),
        *("-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart"),
        *("-f", "mp4", str(path)),
    ]
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=errors)
        assert process.stdin is not None
        try:
            for picture in itertools.chain([first], iterator):
                process.stdin.write(picture.tobytes())
            process.stdin.close()
        except BrokenPipeError:
            pass  # what ffmpeg says about it follows
        except BaseException:
            process.kill()
            process.wait()
            raise
        if process.wait() != 0:
            errors.seek(0)
            reason = errors.read().decode(errors="replace").strip() or "no reason is given"
            raise ConfigurationError(f"ffmpeg failed: {reason.splitlines()[-1]}")
