# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What is installed where; name, version and dependencies stand in pyproject.toml.

The same file serves colcon (ament_python) and pip. colcon puts the executables into
``lib/mtpgo_ros`` by itself (setup.cfg). pip puts them into ``bin``, so the wheel also carries one
small launcher for each in ``lib/mtpgo_ros``, where ``ros2 run`` looks.
"""

from __future__ import annotations

from pathlib import Path

from setuptools import setup

from distutils.command.install_data import install_data  # isort: skip  (setuptools provides it)

NAME = "mtpgo_ros"
SHARE = f"share/{NAME}"

PACKAGES = [
    "models",
    "msg_adapters",
    "mtpgo_core",
    "mtpgo_ros",
    "mtpgo_training",
    "mtpgo_training.demo",
    "mtpgo_training.readers",
    "mtpgo_training.simulate",
]

EXECUTABLES = {
    "predictor": "mtpgo_ros.predictor:main",
    "replay": "mtpgo_ros.replay:main",
    "record": "mtpgo_ros.record:main",
    "mtpgo": "mtpgo_training.cli:main",
}

LAUNCHER = """\
#!/bin/sh
# The executable of the environment that this package was installed into, for `ros2 run`.
exec "$(dirname "$(readlink -f "$0")")/../../bin/{name}" "$@"
"""


def tree(source: str, target: str) -> list[tuple[str, list[str]]]:
    """data_files entries that copy all files below ``source`` to the same places in ``target``."""
    files: dict[str, list[str]] = {}
    for path in sorted(p for p in Path(source).rglob("*") if p.is_file()):
        folder = Path(target) / path.parent.relative_to(source)
        files.setdefault(folder.as_posix(), []).append(path.as_posix())
    return list(files.items())


class InstallData(install_data):  # type: ignore[misc]
    """Copies the data files and, for pip, writes the launchers."""

    def run(self) -> None:
        """Copy; then write the launchers when it is a wheel that is being built."""
        super().run()
        if not {"bdist_wheel", "editable_wheel"} & set(self.distribution.command_obj):
            return
        folder = Path(self.install_dir, "lib", NAME)
        folder.mkdir(parents=True, exist_ok=True)
        for name in EXECUTABLES:
            launcher = folder / name
            launcher.write_text(LAUNCHER.format(name=name))
            launcher.chmod(0o755)
            self.outfiles.append(str(launcher))


setup(
    packages=PACKAGES,
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (SHARE, ["package.xml"]),
        *tree("launch", f"{SHARE}/launch"),
        *tree("config", f"{SHARE}/config"),
        *tree("resource/weights", f"{SHARE}/weights"),
        *tree("resource/recordings", f"{SHARE}/recordings"),
    ],
    entry_points={"console_scripts": [f"{k} = {v}" for k, v in EXECUTABLES.items()]},
    cmdclass={"install_data": InstallData},
    zip_safe=False,
)
