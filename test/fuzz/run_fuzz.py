# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fuzzes all targets for some seconds: ``make fuzz SECONDS=600``.

Each target runs in a process of its own, guided by the coverage of this project's code where
atheris (libFuzzer) is installed, else by mutation of the valid inputs alone. An unexpected
exception, more than a second of processor time or more than 4 GB of memory is a finding: its
input is kept, and the exit status is 1.

    python test/fuzz/run_fuzz.py --seconds 600 [--target NAME ...]
    python test/fuzz/run_fuzz.py --target NAME --input FILE     # one input again, with traceback
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import importlib.util
import logging
import random
import re
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]

MEMORY_MB = 4096
"""Most memory of a process (MB): torch and the readers need 0.6 GB (measured)."""

_PACKAGES = ["mtpgo_core", "msg_adapters", "mtpgo_training"]


def main() -> int:
    """Run the command line; returns 1 if anything was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0, help="of all targets together")
    parser.add_argument("--target", nargs="+", help="names, default all")
    parser.add_argument("--input", type=Path, help="run this one input of the one target")
    parser.add_argument("--findings", type=Path, default=Path("fuzz_findings"))
    parser.add_argument("--plain", action="store_true", help="without atheris")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.input is not None:
        return _again(arguments.target[0], arguments.input)
    guided = not arguments.plain and importlib.util.find_spec("atheris") is not None
    if arguments.child:
        fuzz = _fuzz_guided if guided else _fuzz_plain
        return fuzz(arguments.target[0], arguments.seconds, arguments.findings)
    return _fuzz_all(arguments, guided)


def _fuzz_all(arguments: argparse.Namespace, guided: bool) -> int:
    from fuzz_target import all_targets

    names = arguments.target or list(all_targets())
    share = arguments.seconds / len(names)
    way = "coverage-guided (atheris)" if guided else "by mutation"
    print(f"{len(names)} targets, {share:.0f} s each, {way}", flush=True)
    total, found = 0, []
    for name in names:
        place = arguments.findings / name
        place.mkdir(parents=True, exist_ok=True)
        done = subprocess.run(
            [sys.executable, __file__, "--child", "--target", name, "--seconds", f"{share:.1f}",
             "--findings", str(place), *(["--plain"] if arguments.plain else [])],
            capture_output=True, text=True, errors="replace", check=False,
        )  # fmt: skip
        ended = f"exit status {done.returncode}\n"
        (place / "log.txt").write_text(done.stdout + done.stderr + ended)
        counts = re.findall(r"number_of_executed_units: *(\d+)|^#(\d+)", done.stderr, re.M)
        inputs = max((int(a or b) for a, b in counts), default=0)
        total += inputs
        bad = [path for path in place.iterdir() if path.name != "log.txt" and _is_bad(name, path)]
        # A process that ended without an input that shows why, for instance for its seeds.
        failed = done.returncode != 0 and not any(place.glob("timeout-*"))
        if bad or failed:
            found.append(name)
        print(f"  {name:24} {inputs:9} inputs, {'FOUND' if bad or failed else 'nothing'}")
        for path in bad or ([place / "log.txt"] if failed else []):
            print(f"    {path}", flush=True)
    print(f"{total} inputs, findings in {', '.join(found) or 'no target'}")
    for folder in (*arguments.findings.iterdir(), arguments.findings):
        if not found and folder.is_dir():
            for log in folder.glob("log.txt"):
                log.unlink()
            with contextlib.suppress(OSError):
                folder.rmdir()
    return 1 if found else 0


def _is_bad(name: str, path: Path) -> bool:
    """Return whether an input fails again: a timeout may be that of a busy machine."""
    command = [sys.executable, __file__, "--target", name, "--input", str(path)]
    try:
        bad = subprocess.run(command, capture_output=True, timeout=60, check=False).returncode != 0
    except subprocess.TimeoutExpired:
        return True
    if not bad:
        path.unlink()
    return bad


def _again(name: str, path: Path) -> int:
    from fuzz_target import HANG_S, all_targets, processor_time

    _limit_memory()
    target = all_targets()[name]
    for seed in target.seeds()[:1]:  # imports and caches are not the input's time
        target.check(seed)
    used = processor_time(target, path.read_bytes())
    print(f"{name}: {path} took {used:.2f} s of processor time")
    return 1 if used > HANG_S else 0


def _fuzz_guided(name: str, seconds: float, findings: Path) -> int:
    import atheris

    with atheris.instrument_imports(include=_PACKAGES):
        from fuzz_target import LARGEST_INPUT, all_targets

        target = all_targets()[name]
    with tempfile.TemporaryDirectory() as corpus:
        for number, seed in enumerate(target.seeds()):
            target.check(seed)
            (Path(corpus) / f"seed{number}").write_bytes(seed)
        limits = [f"-max_total_time={max(1, round(seconds))}", "-timeout=5",
                  f"-rss_limit_mb={MEMORY_MB}", f"-max_len={LARGEST_INPUT}"]  # fmt: skip
        kept = f"-artifact_prefix={findings}/"
        command = [sys.argv[0], *limits, "-print_final_stats=1", kept, corpus]
        atheris.Setup(command, target.check)
        atheris.Fuzz()
    return 0


def _fuzz_plain(name: str, seconds: float, findings: Path) -> int:
    from fuzz_target import HANG_S, all_targets, mutated, processor_time

    _limit_memory()
    target = all_targets()[name]
    draw = random.Random(0)
    seeds = list(target.seeds())
    for seed in seeds:
        target.check(seed)
    end, count, status = time.monotonic() + seconds, 0, 0
    while time.monotonic() < end:
        data = mutated(draw.choice(seeds), draw)
        count += 1
        try:
            failed = processor_time(target, data) > HANG_S
        except Exception as error:
            print(f"{type(error).__name__}: {error}")
            failed = True
        if failed:
            status = 1
            (findings / f"crash-{hashlib.sha1(data).hexdigest()}").write_bytes(data)
    print(f"number_of_executed_units: {count}", file=sys.stderr)
    return status


def _limit_memory() -> None:
    limit = MEMORY_MB << 20
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


if __name__ == "__main__":
    # What readers say about odd input is not looked at here, and there is much of it.
    logging.getLogger("mtpgo").setLevel(logging.ERROR)
    sys.exit(main())
