# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The house keeps its floors: who may import whom, read from the source without running it."""

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
    "mtpgo_ros": {"rclpy", "numpy", "rosbags", "tqdm", "msg_adapters", "mtpgo_core"},
    "mtpgo_training": {
        "jinja2",
        "lightning",
        "matplotlib",
        "mcap",
        "models",
        "msg_adapters",
        "mtpgo_core",
        "numpy",
        "pandas",
        "rosbags",
        "sumo",
        "torch",
        "torch_geometric",
        "tqdm",
        "yaml",
    },
}
"""What each package may import beside itself and the standard library."""

OPTIONAL = {"mtpgo_ros": {"tf2_ros", "ament_index_python"}}
"""What a package may import inside a function only: it must do without."""

WITHOUT_TORCH = ("schema", "identity", "task", "errors", "history", "derivatives", "scene")
"""Modules of the core that an adapter or a reader uses: they must not pay for torch."""


def is_message_package(name: str) -> bool:
    return name.endswith(("_msgs", "_interfaces"))


def imports_of(path: Path) -> list[tuple[str, bool]]:
    """Absolute module names that a file imports, and whether inside of a function."""
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
def test_imports_stay_on_their_floor(package):
    wrong = []
    for path in files_of(package):
        for module, inside in imports_of(path):
            top = module.split(".")[0]
            if top in sys.stdlib_module_names or top == package or top in ALLOWED[package]:
                continue
            if inside and top in OPTIONAL.get(package, ()):
                continue
            if package == "mtpgo_ros" and is_message_package(top):
                continue
            if package == "msg_adapters" and is_message_package(top) and inside:
                continue
            wrong.append(f"{path.relative_to(ROOT)} imports {module}")
    assert not wrong, "\n".join(wrong)


def test_the_check_sees_imports_inside_functions(tmp_path):
    source = tmp_path / "module.py"
    source.write_text("import numpy as np\ndef f():\n    from rclpy.node import Node\n")
    assert imports_of(source) == [("numpy", False), ("rclpy.node", True)]


@pytest.mark.parametrize("module", WITHOUT_TORCH)
def test_the_array_half_of_the_core_does_without_torch(module):
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
def test_a_file_says_whose_it_is_and_what_it_is_for(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines[0] == "# Copyright 2026 the mtpgo_ros developers"
    assert lines[1] == "# SPDX-License-Identifier: Apache-2.0"
    if path.relative_to(ROOT).parts[0] in PACKAGES:
        assert ast.get_docstring(ast.parse("\n".join(lines))), "no module docstring"


KINDS = {
    ".cfg",
    ".csv",
    ".gz",
    ".json",
    ".md",
    ".png",
    ".pt",
    ".py",
    ".rviz",
    ".toml",
    ".txt",
    ".xml",
    ".yaml",
}
LARGEST_BYTES = 8 * 2**20


def test_no_bag_archive_or_cache_is_among_the_shipped_files():
    for folder in (*PACKAGES, "resource", "config", "launch", "docs", "benchmarks", "test"):
        for path in (ROOT / folder).rglob("*"):
            if not path.is_file() or "__pycache__" in path.parts:
                continue
            where = path.relative_to(ROOT)
            assert path.suffix in KINDS or where == Path("resource/mtpgo_ros"), where
            assert path.stat().st_size <= LARGEST_BYTES, f"{where} is too large"
            if path.suffix == ".pt":
                assert where.parts[:2] == ("resource", "weights"), f"{where} is out of place"
            if path.suffix in (".csv", ".gz"):
                assert where.parts[0] in ("resource", "test"), f"{where} is out of place"
