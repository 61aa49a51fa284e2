# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What every benchmark prints and writes: machine, command, tables, JSON."""

from __future__ import annotations

import json
import os
import platform
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mtpgo_core.versions import library_version
from mtpgo_training.atomic_files import require_writable, write_text
from mtpgo_training.table_format import Row, Table, to_markdown

_CPU_INFO = Path("/proc/cpuinfo")


def machine() -> dict[str, object]:
    """Return processor, number of cores, load and versions."""
    return {
        "processor": _processor(),
        "cpu_capability": _capability(),
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 2),
        "torch": library_version("torch"),
        "numpy": library_version("numpy"),
        "python": platform.python_version(),
    }


def heading(command: str) -> str:
    """Return the lines printed above a table: the command and a description of the machine."""
    found = machine()
    return (
        f"$ {command}\n"
        f"{found['processor']}, {found['cores']} cores, {found['cpu_capability']}; "
        f"torch {found['torch']}, numpy {found['numpy']}, Python {found['python']}; "
        f"load before: {found['load']}\n"
    )


def print_heading(command: str, output: Path | None) -> None:
    """Check that the JSON file can be written, if there is to be one, and print the heading.

    Raises:
        ConfigurationError: the file cannot be written.
    """
    if output is not None:
        require_writable(output)
    print(heading(command))


def command_line(kind: str, arguments: Mapping[str, Any]) -> str:
    """Return the command that repeats a measurement.

    Args:
        kind: subcommand of ``mtpgo benchmark``.
        arguments: option (without dashes) -> value; None, False and empty lists are left out.
    """
    words = ["mtpgo", "benchmark", kind]
    for name, value in arguments.items():
        if value is None or value is False or value == []:
            continue
        words.append("--" + name.replace("_", "-"))
        if value is not True:
            words += [str(v) for v in value] if isinstance(value, list) else [f"{value}"]
    return shlex.join(words)


def write_json(path: Path | None, content: Mapping[str, Any]) -> None:
    """Write the machine and the content to a file, atomically; NaN becomes null.

    Args:
        path: JSON file; None writes nothing.
        content: plain data.

    Raises:
        ConfigurationError: the file cannot be written.
    """
    if path is None:
        return
    text = json.dumps({"machine": machine(), **content})
    plain = json.loads(text, parse_constant=lambda _: None)  # JSON has no NaN
    write_text(path, json.dumps(plain, indent=2) + "\n")


def table(rows: Sequence[object], columns: Mapping[str, str]) -> str:
    """Return rows as a Markdown table.

    Args:
        rows: one object per line.
        columns: heading -> format of the cell, for example ``"{.p99_ms:.1f}"``; NaN becomes "-".
    """
    texts = ([form.format(row) for form in columns.values()] for row in rows)
    cells = (["-" if text == "nan" else text for text in line] for line in texts)
    lines = [Row(name, rest) for name, *rest in cells]
    return to_markdown(Table(list(columns), lines), "---:")


def _processor() -> str:
    """Return model name and family from /proc/cpuinfo; without that file, what Python reports."""
    if not _CPU_INFO.is_file():
        return platform.processor() or platform.machine()
    facts: dict[str, str] = {}
    for line in _CPU_INFO.read_text(encoding="utf-8").splitlines():
        name, _, value = line.partition(":")
        facts.setdefault(name.strip(), value.strip())
    name = facts.get("model name", platform.machine())
    return f"{name} (family {facts['cpu family']})" if "cpu family" in facts else name


def _capability() -> str:
    import torch  # imported late: loading it takes about a second

    return str(torch.backends.cpu.get_cpu_capability())
