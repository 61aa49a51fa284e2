# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Shell in the pages is valid, and its commands are those that there are; cheap ones are run."""

import re
import shutil
import subprocess

import command_checks
import page_blocks
import pytest
from page_blocks import PAGES, ROOT, Block, all_blocks, commands_in, script_of

from mtpgo_training.cli import main

SHELL = [block for block in all_blocks() if block.language in ("sh", "bash", "console")]

CHEAP = (
    "mtpgo info default",
    "mtpgo data highD/data --layout highd",
    "mtpgo convert highd highD/data -o 01.mcap --recordings 01",
)
"""Commands of the pages that are run, in a folder with ``highD/data``."""

LAST_CHANGE = "what earlier versions had"


def checked(block: Block) -> list[str]:
    """Return what is wrong with a block, one sentence for each fault."""
    script = script_of(block)
    done = subprocess.run(
        ["bash", "-n"], input=script, text=True, capture_output=True, check=False
    )
    if done.returncode:
        return [
            f"{block.place} is no shell: {done.stderr.strip()}. A block that is not shell"
            " names its language after the fence, such as text"
        ]
    return [
        f"{block.place}: {' '.join(words)}: {said}"
        for words in commands_in(script)
        if (said := command_checks.problem_with(words))
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_shell_blocks_are_commands_that_there_are(page):
    blocks = [block for block in SHELL if block.page == page and not block.reason]
    assert [fault for block in blocks for fault in checked(block)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_in_sentences_exist(page):
    if page.name == "CHANGELOG.md":
        pytest.skip(LAST_CHANGE)
    text = re.sub(r"^( *)```.*?^\1```", "", page.read_text("utf-8"), flags=re.DOTALL | re.M)
    spans = [re.sub(r"\s+", " ", code) for code in re.findall(r"`((?:mtpgo|make) [^`]+)`", text)]
    faults = {code: command_checks.inline_problem(code) for code in spans}
    assert {code: said for code, said in faults.items() if said} == {}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with ``highD/data``, made of the recording that ships with the package."""
    folder = tmp_path_factory.mktemp("pages")
    shutil.copytree(ROOT / "resource" / "recordings" / "highway", folder / "highD" / "data")
    return folder


@pytest.mark.parametrize("command", CHEAP)
def test_cheap_commands_are_run(command, folder, monkeypatch, capsys):
    shown = {
        " ".join(words)
        for block in SHELL
        for words in commands_in(script_of(block))
        if words[0] == "mtpgo"
    }
    pages = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert command in shown or f"`{command}`" in pages, "no page shows it any more"
    monkeypatch.chdir(folder)
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    assert main(command.split()[1:]) == 0
    assert capsys.readouterr().out


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("mtpgo train", "required"),
        ("mtpgo evaluate --modell default", "unrecognized"),
        ("mtpgo improve x", "no command improve"),
        ("predictor --ros-args -p modell:=x", "no parameter modell"),
        ("predictor --ros-args -p rate:=1000", "rate is 1000"),
        ("replay 07.mcap --speed 2", "unrecognized"),
        ("ros2 launch mtpgo_ros predictor.launch.py tempo:=2", "no argument tempo"),
        ("ros2 run mtpgo_ros foresee", "no executable foresee"),
        ("make demonstration", "no target demonstration"),
        ("make demo DATEN=x", "no variable DATEN"),
        ("pip install '.[rso]'", "extra"),
        ("pip install -r requirements/robots.txt", "there is no"),
        ("FOO=1 foresee now > file", "no command"),
    ],
)
def test_a_wrong_command_is_found(line, fault):
    (words,) = commands_in(line)
    assert fault in command_checks.problem_with(words)


def test_commands_of_a_script_are_found():
    block = next(
        page_blocks.blocks_of("```\n$ A=1 x 'b c' & y \\\n  z > f  # no\nout\n$ w\n```\n")
    )
    assert block.language == "console"
    assert list(commands_in(script_of(block))) == [["x", "b c"], ["y", "z"], ["w"]]


def test_a_reason_not_to_run_belongs_to_the_block_below():
    text = "<!-- not run: takes an hour -->\n\n```sh\nx\n```\n\n```python\ny\n```\n"
    found = [(block.language, block.reason) for block in page_blocks.blocks_of(text)]
    assert found == [("sh", "takes an hour"), ("python", "")]
