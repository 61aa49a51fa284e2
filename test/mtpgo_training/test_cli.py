# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command line: one line and status 2 for bad input, and no needless imports."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from mtpgo_training import cli
from mtpgo_training.atomic_files import replacing
from mtpgo_training.data.readers import load_recordings

sys.path.insert(0, str(Path(__file__).parent))
import drone_files


def test_convert_writes_the_file_it_prints(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = drone_files.write_highd(tmp_path / "highd")
    output = tmp_path / "out.mcap"
    status = cli.main(["convert", "highd", str(source), "-o", str(output), "--ego", "2"])
    assert status == 0
    assert "1 recording(s) (01), 0.0 s, 2 frames, 4 messages" in capsys.readouterr().out
    assert load_recordings(output, "bag")[0].ego_id == 2


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["convert", "foo", "{dir}", "-o", "{out}"], "the layout 'foo' is unknown, expected one"),
        (["convert", "ind", "{dir}", "-o", "{out}"], "has the layout 'highd', but 'ind' was"),
        (["convert", "highd", "{dir}/no", "-o", "{out}"], "no does not exist, expected a dir"),
        (["convert", "highd", "{dir}", "-o", "{dir}/01_tracks.csv/x"], "cannot be written: "),
        (["convert", "highd", "{dir}", "-o", "{out}", "--ego", "77"], "the ego 77 is in none"),
        (
            ["convert", "highd", "{dir}", "-o", "{out}", "--recordings", "9"],
            "has no recording '9'",
        ),
        (["simulate", "highway", "-o", "{out}", "--lanes", "9"], "lanes is 9, expected 2 to 4"),
    ],
)
def test_bad_input_is_one_line_and_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], sentence: str
) -> None:
    source = drone_files.write_highd(tmp_path / "highd")
    before = sorted(tmp_path.rglob("*"))
    filled = [a.format(dir=source, out=tmp_path / "out.mcap") for a in arguments]
    assert cli.main(filled) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert sentence in captured.err
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("line", "begin", "end"),
    [
        ("", "mtpgo: the following arguments are required: COMMAND", ""),
        ("xyz", "mtpgo: argument COMMAND: invalid choice: 'xyz'", "'view')"),
        ("evalute", "mtpgo: argument COMMAND: invalid choice: ", ", did you mean evaluate?"),
        ("convert", "mtpgo convert: the following arguments are required: layout, dir", ""),
        ("data a --layout ind b", "mtpgo data: unrecognized arguments: b", ""),
        ("evaluate --calibration onlin", "mtpgo evaluate: argument ", ", did you mean online?"),
        ("benchmark nod", "mtpgo benchmark: argument KIND: ", ", did you mean node?"),
    ],
)
def test_wrong_usage_is_one_sentence_and_status_2(
    capsys: pytest.CaptureFixture[str], line: str, begin: str, end: str
) -> None:
    with pytest.raises(SystemExit) as stopped:
        cli.main(line.split())
    assert stopped.value.code == 2
    said = capsys.readouterr().err
    program = begin.partition(":")[0]
    assert said.startswith(begin)
    assert said.endswith(f"{end} (see {program} --help)\n")
    assert said.count("\n") == 1


def test_interrupt_is_status_130(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def interrupted(args: object) -> int:
        raise KeyboardInterrupt

    import mtpgo_training.commands.convert

    monkeypatch.setattr(mtpgo_training.commands.convert, "run", interrupted)
    assert cli.main(["convert", "highd", str(tmp_path), "-o", str(tmp_path / "x")]) == 130
    assert "Traceback" not in capsys.readouterr().err


def test_help_loads_no_heavy_library() -> None:
    code = (
        "import sys\n"
        "from mtpgo_training import cli\n"
        "try:\n"
        "    cli.main(['--help'])\n"
        "except SystemExit:\n"
        "    pass\n"
        "print(sorted({'torch', 'pandas', 'rosbags', 'matplotlib', 'numpy'} & set(sys.modules)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[2],
    )
    assert done.stdout.splitlines()[-1] == "[]"
    for name, text in cli.COMMANDS.items():
        assert name in done.stdout
        assert text.split()[0] in done.stdout


def test_an_output_that_is_closed_early_is_no_error() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "mtpgo_training.cli", "info", "default"],
            stdout=writer,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    finally:
        os.close(writer)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.parametrize(
    ("words", "attribute"),
    [
        (["evaluate", "--model", "a", "--model", "b"], "model"),
        (["evaluate", "--predictions", "a", "--predictions", "b"], "predictions"),
        (["crossval", "--folds", "a", "--folds", "b"], "folds"),
        (["study", "layers", "--rows", "a", "--rows", "b"], "rows"),
        (["export", "run", "-o", "m", "--calibration", "a", "--calibration", "b"], "calibration"),
    ],
)
def test_an_option_with_several_values_may_be_repeated(words: list[str], attribute: str) -> None:
    """No value is dropped without a message."""
    given = cli.build_parser(words[0]).parse_args(words)
    assert [str(value) for value in getattr(given, attribute)] == ["a", "b"]


CLI = [sys.executable, "-m", "mtpgo_training.cli"]

BUFFERING = [{**os.environ, "PYTHONUNBUFFERED": value} for value in ("", "1")]
"""Without a buffer argparse itself meets what cannot be written, and drops it."""


@pytest.mark.parametrize("env", BUFFERING, ids=["buffer", "no buffer"])
def test_help_into_a_closed_output_is_no_error(env: dict[str, str]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        done = subprocess.run(
            [*CLI, "layouts", "--help"],
            stdout=writer,
            stderr=subprocess.PIPE,
            env=env,
            check=False,
        )
    finally:
        os.close(writer)
    assert (done.returncode, done.stderr) == (141, b"")


@pytest.mark.parametrize("env", BUFFERING, ids=["buffer", "no buffer"])
@pytest.mark.parametrize("words", [["--help"], ["layouts", "--help"], ["--version"]], ids=str)
def test_a_full_disk_behind_the_output_is_one_line(words: list[str], env: dict[str, str]) -> None:
    with open("/dev/full", "w", encoding="utf-8") as full:
        done = subprocess.run(
            [*CLI, *words],
            stdout=full,
            env=env,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (done.returncode, done.stderr) == (2, "mtpgo: No space left on device\n")


def test_streams_that_are_closed_are_no_error(tmp_path: Path) -> None:
    """As cron and service managers may start it; the file is written all the same."""
    source = drone_files.write_highd(tmp_path / "highd")
    words = ["data", str(source), "--layout", "highd", "--no-cache"]
    line = 'exec "$@" <&- >&- 2>&-'
    done = subprocess.run(
        ["sh", "-c", line, "sh", *CLI, *words, "--json", str(tmp_path / "out.json")], check=False
    )
    assert done.returncode == 0
    assert json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "mtpgo: No space left on device\n"),
        (FileNotFoundError(errno.ENOENT, "Gone", "a.csv"), "mtpgo: a.csv: Gone\n"),
        (OSError("cannot do that"), "mtpgo: cannot do that\n"),
    ],
)
def test_what_the_system_refuses_is_one_line(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: OSError,
    sentence: str,
) -> None:
    import mtpgo_training.commands.layouts.layouts_command as layouts

    def refused(args: object) -> int:
        raise error

    monkeypatch.setattr(layouts, "run", refused)
    assert cli.main(["layouts"]) == 2
    assert capsys.readouterr().err == sentence


def test_a_deleted_working_directory_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    import mtpgo_training.commands.layouts.layouts_command as layouts

    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    monkeypatch.setattr(layouts, "run", lambda args: Path.cwd())
    (tmp_path / "gone").rmdir()
    assert cli.main(["layouts"]) == 2
    told = capsys.readouterr().err
    assert told == "mtpgo: the working directory cannot be used: No such file or directory\n"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_ends_the_command_leaves_nothing_behind(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, number: signal.Signals
) -> None:
    import mtpgo_training.commands.layouts.layouts_command as layouts

    def ended(args: object) -> int:
        with replacing(tmp_path / "a") as temporary:
            temporary.write_text("half")
            signal.raise_signal(number)
        raise AssertionError("it went on")

    monkeypatch.setattr(layouts, "run", ended)
    before = signal.signal(number, signal.SIG_DFL)  # nohup ignores SIGHUP
    try:
        with pytest.raises(SystemExit) as stopped:
            cli.main(["layouts"])
        assert signal.getsignal(number) == signal.SIG_DFL
    finally:
        signal.signal(number, before)
    assert stopped.value.code == 128 + number
    assert list(tmp_path.iterdir()) == []


def test_nohup_is_respected(monkeypatch: pytest.MonkeyPatch) -> None:
    import mtpgo_training.commands.layouts.layouts_command as layouts

    def lives(args: object) -> int:
        signal.raise_signal(signal.SIGHUP)
        return 0

    monkeypatch.setattr(layouts, "run", lives)
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert cli.main(["layouts"]) == 0
    finally:
        signal.signal(signal.SIGHUP, before)
