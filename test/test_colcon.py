# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""`colcon test` runs pytest, and `colcon test-result` shows what passed and what failed."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from needed_packages import NEEDED, is_installed, left_out, missing_for

ROOT = Path(__file__).resolve().parents[1]
PASSING = "def test_passes():\n    pass\n"
FAILING = "def test_fails():\n    assert 1 == 2\n"
NEEDING = "import a_package_that_nobody_has\n"


def colcon(*arguments: str, cwd: Path) -> subprocess.CompletedProcess:
    """Run colcon with its output in ``cwd``."""
    folder = Path(sys.executable).parent
    command = shutil.which("colcon", path=f"{folder}:{os.environ['PATH']}")
    assert command, "colcon is not installed, expected from requirements/development.txt"
    hidden = ("PYTHONPATH", "AMENT_PREFIX_PATH", "PYTEST_")
    env = {k: v for k, v in os.environ.items() if not k.startswith(hidden)}
    env["PATH"] = f"{folder}:{env['PATH']}"
    return subprocess.run(
        [command, "--log-base", "log", *arguments],
        cwd=cwd,
        env=env,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def workspace(tmp_path) -> Path:
    """A workspace with this package's own build files and settings, little code, three tests."""
    package = tmp_path / "src"
    (package / "resource").mkdir(parents=True)
    names = ("package.xml", "setup.py", "setup.cfg", "pyproject.toml", "README.md")
    for name in (*names, "resource/mtpgo_ros"):
        shutil.copy2(ROOT / name, package / name)
    (package / "mtpgo_ros").mkdir()
    (package / "mtpgo_ros" / "__init__.py").touch()
    test = package / "test"
    test.mkdir()
    (test / "test_passes.py").write_text(PASSING)
    (test / "test_fails.py").write_text(FAILING)
    shutil.copy2(ROOT / "test" / "conftest.py", test)
    (test / "selection").mkdir()
    needed = (ROOT / "test" / "selection" / "needed_packages.py").read_text()
    nobody_has = '{"test_needs.py": ("a_package_that_nobody_has",)}'
    (test / "selection" / "needed_packages.py").write_text(
        f"{needed}\nNEEDED.update({nobody_has})\n"
    )
    (test / "test_needs.py").write_text(NEEDING)
    # What `colcon test` asks for of the build, which test_packaging.py tests.
    environment = tmp_path / "install" / "mtpgo_ros" / "share" / "mtpgo_ros" / "package.sh"
    environment.parent.mkdir(parents=True)
    environment.touch()
    return tmp_path


# colcon reads setup.py in a process of its own, which takes long on a busy machine.
@pytest.mark.timeout(600)
def test_colcon_test_runs_the_tests_and_reports_the_one_that_fails(workspace):
    done = colcon("test", "--return-code-on-test-failure", cwd=workspace)
    assert done.returncode == 1, done.stdout + done.stderr
    shown = colcon("test-result", "--verbose", cwd=workspace)
    assert shown.returncode == 1
    assert "Summary: 2 tests, 0 errors, 1 failure, 0 skipped" in shown.stdout
    assert "test_fails" in shown.stdout
    log = (workspace / "log/latest_test/mtpgo_ros/stdout.log").read_text()
    assert "test/test_needs.py is left out: a_package_that_nobody_has not installed" in log


def test_what_a_robot_lacks_is_left_out_with_a_sentence():
    def without_torch_geometric(package: str) -> bool:
        return package != "torch_geometric"

    assert missing_for("models", without_torch_geometric) == ["torch_geometric"]
    assert missing_for("mtpgo_core", without_torch_geometric) == []
    lines = left_out(without_torch_geometric)
    assert "test/models is left out: torch_geometric not installed" in lines
    assert not any(line.startswith("test/mtpgo_ros is") for line in lines)


def test_the_table_of_needed_packages_names_tests_that_exist():
    for name in NEEDED:
        assert (ROOT / "test" / name).exists(), name
    assert is_installed("numpy")
    assert not is_installed("no_such_package.at_all")
