# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""On what, and by which command, a figure was measured: stands above every table."""

from __future__ import annotations

import json
import os
import platform
import shlex
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from mtpgo_training.atomic_files import write_text

_CPU_INFO = Path("/proc/cpuinfo")


def machine() -> dict[str, object]:
    """Processor, cores and versions, as far as the system tells."""
    return {
        "processor": _processor(),
        "cpu_capability": _capability(),
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 2),
        "torch": _version("torch"),
        "numpy": _version("numpy"),
        "python": platform.python_version(),
    }


def heading(command: str) -> str:
    """Lines that stand above a table: the command, and the machine in words."""
    found = machine()
    return (
        f"$ {command}\n"
        f"{found['processor']}, {found['cores']} cores, {found['cpu_capability']}; "
        f"torch {found['torch']}, numpy {found['numpy']}, Python {found['python']}; "
        f"load before: {found['load']}\n"
    )


def command_line(kind: str, arguments: Mapping[str, Any]) -> str:
    """The command that repeats a measurement.

    Args:
        kind: of ``mtpgo benchmark``.
        arguments: option (without dashes) -> value; None, False and empty ones are left out.
    """
    words = ["mtpgo", "benchmark", kind]
    for name, value in arguments.items():
        if value is None or value is False or value == []:
            continue
        words.append("--" + name.replace("_", "-"))
        if value is not True:
            words += [str(v) for v in value] if isinstance(value, list) else [f"{value}"]
    return shlex.join(words)


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """The content with the machine before it, whole or not at all; NaN becomes null.

    Raises:
        ConfigurationError: the file cannot be written.
    """
    text = json.dumps({"machine": machine(), **content})
    plain = json.loads(text, parse_constant=lambda _: None)  # JSON knows no NaN
    write_text(path, json.dumps(plain, indent=2) + "\n")


def markdown(head: list[str], rows: list[list[str]]) -> str:
    """A table of right-aligned columns."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---:|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def _processor() -> str:
    """Name and family, as /proc tells; elsewhere what Python knows."""
    if not _CPU_INFO.is_file():
        return platform.processor() or platform.machine()
    facts: dict[str, str] = {}
    for line in _CPU_INFO.read_text(encoding="utf-8").splitlines():
        name, _, value = line.partition(":")
        facts.setdefault(name.strip(), value.strip())
    name = facts.get("model name", platform.machine())
    return f"{name} (family {facts['cpu family']})" if "cpu family" in facts else name


def _capability() -> str:
    import torch  # a second: only here

    return str(torch.backends.cpu.get_cpu_capability())


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"
