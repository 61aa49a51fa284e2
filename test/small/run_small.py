# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Installs the wheel with the extra ``ros`` alone, measures it and plays the demo: ``make small``.

Prints the size of the environment, its largest packages, and the time from the end of the
installation to the first prediction. Exit status 1 if a package of another extra came along, or
if the demo fails.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test"))
import declared  # noqa: E402

CPU_INDEX = "https://download.pytorch.org/whl/cpu"
"""Index of PyTorch's builds without CUDA."""

FIRST = "first prediction"
"""Begin of the line that the demo prints with the first prediction."""

LARGEST = 8
"""Packages that are listed; chosen."""


def size_mb(folder: Path) -> float:
    """Return the size of all files in a folder (10^6 bytes), links not followed."""
    files = (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    return sum(path.stat().st_size for path in files) / 1e6


def install(folder: Path) -> Path:
    """Make the environment and return its folder of executables."""
    venv.create(folder, with_pip=True, clear=True)
    binaries = folder / "bin"
    pip = [str(binaries / "python"), "-m", "pip", "install", "-q", "--disable-pip-version-check"]
    (torch,) = [str(one) for one in declared.requirements() if one.name == "torch"]
    if subprocess.run([*pip, "--index-url", CPU_INDEX, torch], check=False).returncode != 0:
        print(f"{CPU_INDEX} is not reachable: pip chooses the build of PyTorch", flush=True)
    wheels = folder / "wheels"
    wheel = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(wheels), str(ROOT)]
    subprocess.run(wheel, check=True)
    (built,) = wheels.glob("*.whl")
    subprocess.run([*pip, f"{built}[ros]"], check=True)
    built.unlink()
    return binaries


def print_size(folder: Path) -> None:
    """Print the size of the environment and of its largest packages."""
    (packages,) = (folder / "lib").glob("python3*/site-packages")
    sizes = sorted(
        ((size_mb(path), path.name) for path in packages.iterdir() if path.is_dir()), reverse=True
    )
    print(f"size of the environment: {size_mb(folder):.0f} MB", flush=True)
    for size, name in sizes[:LARGEST]:
        print(f"  {size:6.0f} MB  {name}")


def foreign_packages(binaries: Path) -> list[str]:
    """Return what is installed although only extras other than ``ros`` name it."""
    code = "import importlib.metadata as m; print(*{d.name.lower() for d in m.distributions()})"
    done = subprocess.run(
        [str(binaries / "python"), "-c", code], capture_output=True, text=True, check=True
    )
    # What torch and the ROS wheels need themselves is no surprise.
    shared = {"jinja2", "pyyaml", "setuptools"}
    others = {
        one.name.lower()
        for extra, packages in declared.extras().items()
        if extra != "ros"
        for one in packages
    }
    return sorted(others & set(done.stdout.split()) - shared)


def play(binaries: Path, output: Path) -> float | None:
    """Play the demo, pass on what it prints, return the time to the first prediction (s)."""
    begun, first = time.monotonic(), None
    hidden = ("PYTHONPATH", "AMENT_PREFIX_PATH")
    with subprocess.Popen(
        [str(binaries / "mtpgo"), "demo", "-o", str(output)],
        stdout=subprocess.PIPE,
        text=True,
        cwd=output.parent,
        env={k: v for k, v in os.environ.items() if k not in hidden},
    ) as demo:
        for line in demo.stdout:
            if first is None and FIRST in line:
                first = time.monotonic() - begun
            print(line, end="", flush=True)
    return first if demo.returncode == 0 else None


def main() -> int:
    """Run and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="environment to make; is overwritten")
    folder = parser.parse_args().folder.resolve()
    binaries = install(folder)
    print_size(folder)
    foreign = foreign_packages(binaries)
    if foreign:
        print(f"packages of other extras are installed: {', '.join(foreign)}", file=sys.stderr)
    first_s = play(binaries, folder / "demo_output")
    if first_s is None:
        print("the demo failed or showed no prediction", file=sys.stderr)
        return 1
    print(f"first prediction {first_s:.1f} s after the end of the installation")
    return 1 if foreign else 0


if __name__ == "__main__":
    sys.exit(main())
