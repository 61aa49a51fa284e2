# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Packages, data files, executables and dependencies; name and version are read from package.xml.

Both colcon (ament_python) and pip use this file. colcon installs the executables into
``lib/mtpgo_ros`` (setup.cfg). pip installs them into ``bin``, so the wheel also contains one small
launcher per executable in ``lib/mtpgo_ros``, where ``ros2 run`` looks for them.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

from distutils.command.install_data import install_data  # isort: skip  (setuptools provides it)

HERE = Path(__file__).resolve().parent
"""The source tree, also when colcon runs this file through a symbolic link."""

MANIFEST = ElementTree.parse(HERE / "package.xml").getroot()
NAME = MANIFEST.findtext("name", "")
SHARE = f"share/{NAME}"

PACKAGES = ("models", "msg_adapters", "mtpgo_core", "mtpgo_ros", "mtpgo_training")

EXECUTABLES = {
    "predictor": "mtpgo_ros.predictor:run",
    "replay": "mtpgo_ros.replay:run",
    "record": "mtpgo_ros.record:run",
    "risk": "mtpgo_ros.risk:run",
    "mtpgo": "mtpgo_training.cli:main",
}

# docs/design.md, Dependencies, gives the purpose of each package. A package stays below its next
# major version, or minor version while it is at 0, except those that count years or quarters.
REQUIREMENTS = [
    "backports.zstd>=1.0,<2",
    "filelock>=3.12,<5",
    "lz4>=4.0,<5",
    "numpy>=1.26,<3",
    "pandas>=2.2,<4",
    "platformdirs>=4.0,<5",
    "torch>=2.13,<3",
    "mcap>=1.2,<2",
    "rosbags>=0.11,<0.12",
    "ruamel.yaml>=0.18,<0.20",
    "tqdm>=4.60,<5",
]
# What the test suite imports. The extra is called `test`: colcon runs pytest for packages whose
# requirements for tests name it, and unittest, which finds nothing here, for others.
TEST = [
    "hypothesis>=6.100",
    "mcap-ros2-support>=0.5",
    "pytest>=7.4",
    "pytest-timeout>=2.2",
]
EXTRAS = {
    # ROS 2 Jazzy as wheels, for machines without ROS. Where ROS is installed, that one is used.
    "ros": ["ros-rclpy[fastrtps]==7.1.6", "ros-jazzy-common-interfaces==5.3.6"],
    "training": [
        "Jinja2>=3.1,<4",
        "lightning-fabric>=2.5,<3",
        "matplotlib>=3.8,<4",
        "psutil>=5.9,<8",
        "PyYAML>=6.0,<7",
        "scipy>=1.11,<2",
        "tensorboard>=2.16,<3",
        "torch-geometric>=2.6,<3",
    ],
    # Parquet and Feather files, and Waymo's protocol buffers with their check sums.
    "datasets": ["google-crc32c>=1.5,<2", "protobuf>=4.21,<8", "pyarrow>=14.0"],
    # Many recordings on several processes or machines; cryptography encrypts what they exchange.
    "fleet": ["cryptography>=42.0", "distributed>=2024.8"],
    "simulation": ["eclipse-sumo>=1.20,<2"],
    # Completion of command lines in a shell, docs/command_line.md.
    "completion": ["argcomplete>=3.0,<4"],
    # Lane files in latitudes and longitudes.
    "maps": ["pyproj>=3.6,<4"],
    # The documentation site; MkDocs 2 has another configuration and no plugins.
    "docs": ["latex2mathml>=3.77,<4", "mkdocs>=1.6,<2", "mkdocs-material>=9.6,<10"],
    # Animations, films (imageio-ffmpeg carries ffmpeg) and rerun; the viewer's page needs none.
    "view": ["imageio-ffmpeg>=0.5,<0.9", "matplotlib>=3.8,<4", "rerun-sdk>=0.27,<0.42"],
    "test": TEST,
    "development": [
        *TEST,
        "build>=1.2",
        "colcon-common-extensions>=0.3",
        "mypy>=1.11",
        "pytest-benchmark>=5.0",
        "pytest-xdist>=3.6",
        "ruff>=0.6",
        "setuptools>=68,<80",
    ],
}

LAUNCHER = """\
#!/bin/sh
# Start the executable of the environment that contains this package, for `ros2 run`.
exec "$(dirname "$(readlink -f "$0")")/../../bin/{name}" "$@"
"""


def tree(source: str, target: str) -> list[tuple[str, list[str]]]:
    """Return data_files entries that copy the tree ``source`` to ``target``."""
    files: dict[str, list[str]] = {}
    for path in sorted(Path(source).rglob("*")):
        if not path.is_file() or path.suffix == ".pyc":
            continue
        folder = Path(target) / path.parent.relative_to(source)
        files.setdefault(folder.as_posix(), []).append(path.as_posix())
    return list(files.items())


class InstallData(install_data):  # type: ignore[misc]
    """Copy the data files and, for pip, write the launchers."""

    def run(self) -> None:
        """Copy the data files; when building a wheel, also write the launchers."""
        super().run()
        if "bdist_wheel" not in self.distribution.command_obj:
            return
        folder = Path(self.install_dir, "lib", NAME)
        folder.mkdir(parents=True, exist_ok=True)
        for name in EXECUTABLES:
            launcher = folder / name
            launcher.write_text(LAUNCHER.format(name=name))
            launcher.chmod(0o755)
            self.outfiles.append(str(launcher))


setup(
    name=NAME,
    version=MANIFEST.findtext("version"),
    description=" ".join(MANIFEST.findtext("description", "").split()),
    long_description=(HERE / "README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    license=MANIFEST.findtext("license"),
    maintainer=MANIFEST.findtext("maintainer"),
    maintainer_email=MANIFEST.find("maintainer").attrib["email"],
    python_requires=">=3.11",
    install_requires=REQUIREMENTS,
    extras_require=EXTRAS,
    packages=find_packages(include=[*PACKAGES, *(f"{name}.*" for name in PACKAGES)]),
    package_data={
        "mtpgo_training.reports": ["*.j2"],
        "mtpgo_training.view": ["page/*"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (SHARE, ["package.xml"]),
        *tree("launch", f"{SHARE}/launch"),
        *tree("config", f"{SHARE}/config"),
        # Headers go below a folder of the package's name, as ROS 2 has it, so that the include
        # folder of one package shows no other's.
        *tree("include", f"include/{NAME}"),
        *tree("cmake", f"{SHARE}/cmake"),
        *tree("resource/weights", f"{SHARE}/weights"),
        *tree("resource/recordings", f"{SHARE}/recordings"),
    ],
    entry_points={"console_scripts": [f"{k} = {v}" for k, v in EXECUTABLES.items()]},
    cmdclass={"install_data": InstallData},
    zip_safe=False,
)
