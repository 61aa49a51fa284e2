# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Imports between packages and rooms, unique names and file sizes, read from the source code."""

import ast
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("models", "mtpgo_core", "msg_adapters", "mtpgo_ros", "mtpgo_training")

ALLOWED = {
    "models": {"torch", "torch_geometric"},
    "mtpgo_core": {"numpy", "torch"},
    "msg_adapters": {"numpy", "mtpgo_core"},
    "mtpgo_ros": {"rclpy", "numpy", "tqdm", "msg_adapters", "mtpgo_core"},
    "mtpgo_training": {
        "filelock",
        "jinja2",
        "lightning_fabric",
        "matplotlib",
        "mcap",
        "models",
        "msg_adapters",
        "mtpgo_core",
        "numpy",
        "pandas",
        "platformdirs",
        "psutil",
        "rerun",
        "rosbags",
        "scipy",
        "sumo",
        "torch",
        "torch_geometric",
        "tqdm",
        "yaml",
    },
}
"""What each package may import in addition to itself and the standard library."""

LARGEST_ROOM = 12
"""Largest number of files in a folder, not counting __init__.py."""

ALLOWED_IN_ROOM = {"msg_adapters.bags": {"backports", "lz4", "rosbags", "ruamel"}}
"""What a single room may import besides: a bag is a file of messages, and both top packages use
the one writer; the other adapters work on messages of any library. Besides rosbags these are the
libraries that it decompresses and reads metadata with: what is cut off must be read in parts."""

ALLOWED_MODULES = {"models": {"mtpgo_core.errors", "mtpgo_core.options"}}
"""Single modules of another package that a package may import: the declaration of options, which
imports the standard library only."""

OPTIONAL = {
    "mtpgo_core": {"argcomplete", "pyproj", "yaml"},
    "mtpgo_ros": {"bondpy", "tf2_ros"},
    "msg_adapters": {"ament_index_python", "pandas"},
    "mtpgo_training": {
        "PIL",
        "cloudpickle",
        "dask",
        "distributed",
        "google",
        "google_crc32c",
        "imageio_ffmpeg",
        "pyarrow",
    },
}
"""What a package may import inside a function only: it must do without. A class map is YAML;
argcomplete completes command lines; pyproj projects lane files; pandas makes the data frame of who
asks for one; google, google_crc32c and pyarrow read the files of some data sets; Dask runs several
processes; PIL and imageio_ffmpeg write animations."""

WITHOUT_TORCH = (
    "schema",
    "identity",
    "errors",
    "task.task_description",
    "task.calibration",
    "history.track_history",
    "history.causal_slope",
    "scene.scene_builder",
)
"""Modules of the core that adapters and readers use; they must not import torch."""


ROOMS = {
    "models": (
        "kernels",
        "gnn_layers",
        "network_config",
        "own_frame",
        "mtp_go_config",
        "ablations",
        "",
        "baselines",
        "inference",
    ),
    "mtpgo_core": (
        "",
        "processes",
        "displays",
        "task",
        "history",
        "maps",
        "scene",
        "prediction",
        "quality",
        "live_calibration",
        "risk",
    ),
    "msg_adapters": (
        "types",
        "conversions",
        "stamp_seconds",
        "wire",
        "bags",
        "adapter",
        "inputs",
        "predictions",
        "outputs",
        "registry",
        "ring_traffic",
    ),
    "mtpgo_ros": (
        "runtime",
        "parameters",
        "diagnostics",
        "quality",
        "lifecycle",
        "bags",
        "load",
        "node",
        "risk_node",
        "",
    ),
    "mtpgo_training": (
        "atomic_files",
        "run_files",
        "table_format",
        "processes",
        "data",
        "parallel",
        "scenes",
        "evaluation",
        "calibration",
        "training",
        "export",
        "crossval",
        "adapt",
        "reports",
        "study",
        "sweep",
        "simulate",
        "view",
        "demo",
        "benchmark",
        "commands",
        "cli",
    ),
}
"""The rooms of each package in order: a room imports only itself and the rooms listed before it.

A room is a folder, or a file in the package's root. "" stands for all other files in the root."""


def room_of(module: str) -> str:
    """Return the room of a module, "" for files in the root that ROOMS does not list."""
    package, _, rest = module.partition(".")
    first = rest.partition(".")[0]
    return first if first in ROOMS[package] else ""


def module_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def is_message_package(name: str) -> bool:
    return name.endswith(("_msgs", "_interfaces"))


def imports_of(path: Path) -> list[tuple[str, bool]]:
    """Return the absolute module names that a file imports, and whether inside a function."""
    tree = ast.parse(path.read_text(encoding="utf-8"), str(path))
    inside: set[ast.AST] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            inside.update(ast.walk(node))
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found += [(alias.name, node in inside) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno} imports relatively"
            found.append((node.module or "", node in inside))
    return found


def files_of(package: str) -> list[Path]:
    files = sorted((ROOT / package).rglob("*.py"))
    assert files, f"{package} is empty"
    return files


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_imports_only_what_is_allowed(package):
    wrong = []
    for path in files_of(package):
        room = f"{package}.{room_of(module_of(path))}"
        allowed = ALLOWED[package] | ALLOWED_IN_ROOM.get(room, set())
        for module, inside in imports_of(path):
            top = module.split(".")[0]
            if top in sys.stdlib_module_names or top == package or top in allowed:
                continue
            if module in ALLOWED_MODULES.get(package, ()):
                continue
            if inside and top in OPTIONAL.get(package, ()):
                continue
            if package == "mtpgo_ros" and is_message_package(top):
                continue
            if package == "msg_adapters" and is_message_package(top) and inside:
                continue
            wrong.append(f"{path.relative_to(ROOT)} imports {module}")
    assert not wrong, "\n".join(wrong)


def test_single_modules_that_are_shared_import_only_the_standard_library():
    for shared in ALLOWED_MODULES.values():
        for name in shared:
            for module, _ in imports_of(ROOT.joinpath(*name.split(".")).with_suffix(".py")):
                assert module.split(".")[0] in sys.stdlib_module_names or module in shared


def test_imports_inside_functions_are_found(tmp_path):
    source = tmp_path / "module.py"
    source.write_text("import numpy as np\ndef f():\n    from rclpy.node import Node\n")
    assert imports_of(source) == [("numpy", False), ("rclpy.node", True)]


@pytest.mark.parametrize("module", WITHOUT_TORCH)
def test_the_array_modules_of_the_core_do_not_import_torch(module):
    waiting, seen = [f"mtpgo_core.{module}"], set()
    while waiting:
        name = waiting.pop()
        seen.add(name)
        path = ROOT.joinpath(*name.split(".")).with_suffix(".py")
        if not path.is_file():
            path = ROOT.joinpath(*name.split("."), "__init__.py")
        for imported, _ in imports_of(path):
            assert imported.split(".")[0] != "torch", f"{module} needs torch through {name}"
            if imported.startswith("mtpgo_core.") and imported not in seen:
                waiting.append(imported)


@pytest.mark.parametrize("package", PACKAGES)
def test_rooms_import_only_rooms_before_them(package):
    order = ROOMS[package]
    wrong = []
    for path in files_of(package):
        module = module_of(path)
        if module == package:
            continue
        assert room_of(module) in order, f"{path} is in no room of ROOMS[{package!r}]"
        for imported, _ in imports_of(path):
            if imported.split(".")[0] != package or imported == package:
                continue
            if order.index(room_of(imported)) > order.index(room_of(module)):
                wrong.append(f"{path.relative_to(ROOT)} imports {imported}")
    assert not wrong, "\n".join(wrong)


def test_file_names_are_unique():
    places: dict[str, list[str]] = {}
    for package in PACKAGES:
        for path in files_of(package):
            if path.name != "__init__.py":
                places.setdefault(path.name, []).append(str(path.relative_to(ROOT)))
    twice = {name: found for name, found in places.items() if len(found) > 1}
    assert not twice, twice


def test_public_class_names_are_unique():
    places: dict[str, list[str]] = {}
    for package in PACKAGES:
        for path in files_of(package):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    places.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    twice = {name: found for name, found in places.items() if len(found) > 1}
    assert not twice, twice


def test_a_folder_has_few_files():
    for package in PACKAGES:
        for folder in {path.parent for path in files_of(package)}:
            files = [path.name for path in folder.glob("*.py") if path.name != "__init__.py"]
            assert len(files) <= LARGEST_ROOM, f"{folder.relative_to(ROOT)}: {len(files)} files"
    root = [path.name for path in (ROOT / "mtpgo_training").glob("*.py")]
    assert len(root) <= 8, root


ACROSS_MODULES = {
    "models/baselines/test_learning.py",
    "models/test_properties.py",
    "msg_adapters/test_docs.py",
    "mtpgo_ros/test_launch_and_layouts.py",
    "mtpgo_training/data/readers/test_bad_recordings.py",
}
"""Tests of something that several modules do together."""

ACROSS = {"mtpgo_ros/faults"}
"""Folders of such tests."""


def test_tests_mirror_the_tree():
    for package in PACKAGES:
        for path in sorted((ROOT / "test" / package).rglob("test_*.py")):
            place = path.relative_to(ROOT / "test")
            modules = {file.stem for file in (ROOT / place.parent).glob("*.py")}
            name = path.stem.removeprefix("test_")
            mirrored = any(name == module or name.startswith(f"{module}_") for module in modules)
            across = place.as_posix() in ACROSS_MODULES or place.parent.as_posix() in ACROSS
            assert mirrored or across, place
    assert all((ROOT / "test" / name).is_file() for name in ACROSS_MODULES)


def tree_in_development(package: str) -> list[str]:
    """Return the folders of a package in the tree of docs/development.md, in its order."""
    page = (ROOT / "docs" / "development.md").read_text(encoding="utf-8")
    lines = page.partition("\n```text\n")[2].partition("\n```")[0].splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(f"{package}/"))
    found = []
    for line in lines[start + 1 :]:
        if not line.startswith(" "):
            break
        if line[2] not in " (":
            found.append(line.split()[0].rstrip("/"))
    return found


@pytest.mark.parametrize("package", PACKAGES)
def test_the_tree_in_the_docs_has_every_folder_with_rooms_in_order(package):
    found = tree_in_development(package)
    rooms = [room for room in ROOMS[package] if room and (ROOT / package / room).is_dir()]
    assert [folder for folder in found if "/" not in folder] == rooms
    folders = {path.parent.relative_to(ROOT / package).as_posix() for path in files_of(package)}
    several = {  # a subcommand in a folder of its own is named like the subcommand
        folder
        for folder in folders - {"."}
        if not folder.startswith("commands/") or folder == "commands/arguments"
    }
    assert several <= set(found), sorted(several - set(found))


def test_every_folder_with_code_is_a_package():
    for package in PACKAGES:
        for path in files_of(package):
            assert (path.parent / "__init__.py").is_file(), f"{path.parent} lacks __init__.py"


def python_files() -> list[Path]:
    skipped = {"build", "install", "log", "dist", "runs", "demo_output"}
    return [
        path
        for path in sorted(ROOT.rglob("*.py"))
        if not any(p in skipped or p.startswith(".") for p in path.relative_to(ROOT).parts)
    ]


@pytest.mark.parametrize("path", python_files(), ids=lambda p: str(p.relative_to(ROOT)))
def test_a_file_has_a_licence_header_and_a_docstring(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines[0] == "# Copyright 2026 the mtpgo_ros developers"
    assert lines[1] == "# SPDX-License-Identifier: Apache-2.0"
    if path.relative_to(ROOT).parts[0] in PACKAGES:
        assert ast.get_docstring(ast.parse("\n".join(lines))), "no module docstring"


KINDS = {
    ".c",
    ".cfg",
    ".ckpt",
    ".cpp",
    ".css",
    ".csv",
    ".gz",
    ".html",
    ".j2",
    ".js",
    ".json",
    ".mcap",
    ".md",
    ".png",
    ".pt",
    ".py",
    ".rviz",
    ".service",
    ".toml",
    ".txt",
    ".webp",
    ".xml",
    ".yaml",
}
LARGEST_BYTES = 8 * 2**20
LARGEST_BAG_BYTES = 2 * 2**20


def test_no_archive_cache_or_large_bag_is_among_the_shipped_files():
    for folder in (*PACKAGES, "resource", "config", "launch", "docs", "benchmarks", "test"):
        for path in (ROOT / folder).rglob("*"):
            if not path.is_file() or "__pycache__" in path.parts:
                continue
            where = path.relative_to(ROOT)
            assert path.suffix in KINDS or where == Path("resource/mtpgo_ros"), where
            assert path.stat().st_size <= LARGEST_BYTES, f"{where} is too large"
            if path.suffix in (".pt", ".ckpt"):
                assert where.parts[:2] == ("resource", "weights"), f"{where} is out of place"
            if path.suffix == ".mcap":
                assert where.parts[:2] == ("resource", "recordings"), f"{where} is out of place"
                assert path.stat().st_size <= LARGEST_BAG_BYTES, f"{where} is too large"
                card = path.with_suffix(".md").read_text()
                assert "licence" in card, f"{where}: the card does not say the licence"
            if path.suffix in (".csv", ".gz"):
                assert where.parts[0] in ("resource", "test"), f"{where} is out of place"
