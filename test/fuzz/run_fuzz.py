# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fuzzes all targets for some seconds: ``make fuzz SECONDS=600``.

Each target runs in a process of its own, guided by the coverage of this project's code where
atheris (libFuzzer) is installed, else by mutation of the valid inputs alone. An unexpected
exception, more than a second of processor time, more than 2 GB of memory or the end of the process
is a finding: its input is kept, and the exit status is 1.

    python test/fuzz/run_fuzz.py --seconds 600 [--target NAME ...]
    python test/fuzz/run_fuzz.py --inputs 50000 --target "bag_*" class_map
    python test/fuzz/run_fuzz.py --target NAME --input FILE     # one input again, with traceback
"""

from __future__ import annotations

import argparse
import contextlib
import fnmatch
import hashlib
import importlib.util
import logging
import mmap
import os
import random
import re
import resource
import signal
import struct
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]

MEMORY_MB = 2048
"""Most memory of a process (MB): torch and the readers need 0.6 GB (measured)."""

KILLED_AFTER_S = 5.0
"""Processor time (s) after which an input is given up and its process ended; chosen, well above
``HANG_S``, so that a hang is told from the end of the process."""

KEPT = 3
"""Inputs that are kept of one kind of finding; chosen: more of them say nothing new."""

RESTARTS = 10
"""How often a target goes on after an input has ended its process."""

_MEMORY = Path("/dev/shm")
"""Files of inputs are written here where it exists: it is memory, and no disk limits the speed."""

SLOW_STATUS = 70
"""Exit status of a process that found slow inputs alone, as libFuzzer's: they are tried again,
for the machine may have been busy."""

_SLOW = "slow inputs"
_PACKAGES = ["mtpgo_core", "msg_adapters", "mtpgo_training"]


def main() -> int:
    """Run the command line; returns 1 if anything was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, help="of all targets together (600)")
    parser.add_argument("--inputs", type=int, help="of each target, at most")
    parser.add_argument("--target", nargs="+", help="names, also with * and ?; default all")
    parser.add_argument("--seed", type=int, help="of the mutations, default another in each run")
    parser.add_argument("--input", type=Path, help="run this one input of the one target")
    parser.add_argument("--findings", type=Path, default=Path("fuzz_findings"))
    parser.add_argument("--plain", action="store_true", help="without atheris")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.input is not None:
        return _again(arguments.target[0], arguments.input)
    guided = not arguments.plain and importlib.util.find_spec("atheris") is not None
    if arguments.child:
        return (_fuzz_guided if guided else _fuzz_plain)(arguments)
    if arguments.seconds is None and arguments.inputs is None:
        arguments.seconds = 600.0
    if arguments.seed is None:
        arguments.seed = random.randrange(1 << 31)
    return _fuzz_all(arguments, guided, _chosen(parser, arguments.target))


def _chosen(parser: argparse.ArgumentParser, patterns: list[str] | None) -> list[str]:
    """Return the names of the targets."""
    from fuzz_target import all_targets

    names = list(all_targets())
    for pattern in patterns or ():
        if not fnmatch.filter(names, pattern):
            parser.error(f"no target {pattern!r}, expected of {', '.join(names)}")
    wanted = patterns or ["*"]
    return [name for name in names if any(fnmatch.fnmatchcase(name, one) for one in wanted)]


@dataclass
class _Done:
    """What a target has done.

    Attributes:
        inputs: number of inputs.
        accepted: how many of them were read and not refused, None where it is not known.
        seconds: elapsed time (s).
        failed: something was found besides slow inputs, whether or not it happens again.
    """

    inputs: int = 0
    accepted: int | None = None
    seconds: float = 0.0
    failed: bool = False

    def __str__(self) -> str:
        share = "" if not self.inputs or self.accepted is None else (
            f", {100 * self.accepted / self.inputs:.0f}% accepted"
        )  # fmt: skip
        return f"{self.inputs:9} inputs in {self.seconds:.0f} s{share}"


def _fuzz_all(arguments: argparse.Namespace, guided: bool, names: list[str]) -> int:
    share = None if arguments.seconds is None else arguments.seconds / len(names)
    limits = [] if share is None else [f"{share:.0f} s each"]
    if arguments.inputs is not None:
        limits.append(f"{arguments.inputs} inputs each")
    way = "coverage-guided (atheris)" if guided else "by mutation"
    print(f"{len(names)} targets, {', '.join(limits)}, {way}, seed {arguments.seed}", flush=True)
    total, found = 0, []
    for name in names:
        place = arguments.findings / name
        place.mkdir(parents=True, exist_ok=True)
        done = _fuzz_one(name, arguments, share, place)
        total += done.inputs
        bad = [path for path in place.iterdir() if path.name != "log.txt" and _is_bad(name, path)]
        if bad or done.failed:
            found.append(name)
        print(f"  {name:24} {done}, {'FOUND' if bad or done.failed else 'nothing'}", flush=True)
        for path in bad or ([place / "log.txt"] if done.failed else []):
            print(f"    {path}", flush=True)
    print(f"{total} inputs, findings in {', '.join(found) or 'no target'}", flush=True)
    for folder in (*arguments.findings.iterdir(), arguments.findings):
        if not found and folder.is_dir():
            for log in folder.glob("log.txt"):
                log.unlink()
            with contextlib.suppress(OSError):
                folder.rmdir()
    return 1 if found else 0


def _fuzz_one(name: str, arguments: argparse.Namespace, share: float | None, place: Path) -> _Done:
    """Fuzz one target, in another process whenever an input has ended the one before."""
    done, start = _Done(), time.monotonic()
    (place / "log.txt").unlink(missing_ok=True)
    for attempt in range(RESTARTS):
        command = [sys.executable, __file__, "--target", name, "--findings", str(place),
                   "--seed", str(arguments.seed + attempt)]  # fmt: skip
        if share is not None:
            left = max(1.0, share - (time.monotonic() - start))
            command += ["--seconds", f"{left:.1f}"]
        if arguments.inputs is not None:
            command += ["--inputs", str(arguments.inputs - done.inputs)]
        if arguments.plain:
            command.append("--plain")
        memory = _MEMORY if os.access(_MEMORY, os.W_OK) else None
        with tempfile.TemporaryDirectory(prefix="fuzz_", dir=memory) as scratch:
            state = State.created(Path(scratch) / "state")
            child = subprocess.run(
                [*command, "--child", str(state.path)],
                capture_output=True, text=True, errors="replace", check=False,
                env={**os.environ, "TMPDIR": scratch},
            )  # fmt: skip
            with (place / "log.txt").open("a") as log:
                log.write(f"{child.stdout}{child.stderr}exit status {child.returncode}\n")
            inputs, accepted, last = state.read()
        if inputs:
            done.accepted = (done.accepted or 0) + accepted
            done.inputs += inputs
        else:
            counts = re.findall(r"number_of_executed_units: *(\d+)|^#(\d+)", child.stderr, re.M)
            done.inputs += max((int(a or b) for a, b in counts), default=0)
        if child.returncode >= 0 or not inputs:
            slow = child.returncode == SLOW_STATUS or any(place.glob("timeout-*"))
            done.failed |= child.returncode != 0 and not slow
            break
        done.failed = True
        _keep(place, last)
        if done.inputs == arguments.inputs or (
            share is not None and time.monotonic() - start > share
        ):
            break
    done.seconds = time.monotonic() - start
    return done


class State:
    """What a process does, in memory that outlives it: counts, and the input that it looks at.

    Args:
        path: a file of ``SIZE`` bytes.
    """

    _HEAD = struct.Struct("<QQQ")  # inputs, accepted ones, bytes of the last one

    def __init__(self, path: Path) -> None:
        from fuzz_target import LARGEST_INPUT

        self.path = path
        with path.open("r+b") as stream:
            self._bytes = mmap.mmap(stream.fileno(), self._HEAD.size + LARGEST_INPUT)

    @classmethod
    def created(cls, path: Path) -> State:
        """Return the state in a new file."""
        from fuzz_target import LARGEST_INPUT

        path.write_bytes(bytes(cls._HEAD.size + LARGEST_INPUT))
        return cls(path)

    def note(self, inputs: int, accepted: int, data: bytes) -> None:
        """Note an input that is to be run, and the counts with it."""
        self._bytes[self._HEAD.size : self._HEAD.size + len(data)] = data
        self._HEAD.pack_into(self._bytes, 0, inputs, accepted, len(data))

    def read(self) -> tuple[int, int, bytes]:
        """Return the counts and the last input."""
        inputs, accepted, size = self._HEAD.unpack_from(self._bytes)
        return inputs, accepted, self._bytes[self._HEAD.size : self._HEAD.size + size]


def _keep(findings: Path, data: bytes) -> None:
    (findings / f"crash-{hashlib.sha1(data).hexdigest()}").write_bytes(data)


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
    signal.setitimer(signal.ITIMER_PROF, KILLED_AFTER_S)
    used = processor_time(target, path.read_bytes())
    print(f"{name}: {path} took {used:.2f} s of processor time")
    return 1 if used > HANG_S else 0


def _fuzz_guided(arguments: argparse.Namespace) -> int:
    import atheris

    with atheris.instrument_imports(include=_PACKAGES):
        from fuzz_target import LARGEST_INPUT, all_targets

        target = all_targets()[arguments.target[0]]
    with tempfile.TemporaryDirectory() as corpus:
        for number, seed in enumerate(target.seeds()):
            target.check(seed)
            (Path(corpus) / f"seed{number}").write_bytes(seed)
        limits = [f"-timeout={KILLED_AFTER_S:.0f}", f"-seed={arguments.seed}",
                  f"-rss_limit_mb={MEMORY_MB}", f"-max_len={LARGEST_INPUT}"]  # fmt: skip
        if arguments.seconds is not None:
            limits.append(f"-max_total_time={max(1, round(arguments.seconds))}")
        if arguments.inputs is not None:
            limits.append(f"-runs={arguments.inputs}")
        kept = f"-artifact_prefix={arguments.findings}/"
        command = [sys.argv[0], *limits, "-print_final_stats=1", kept, corpus]

        def check(data: bytes) -> None:
            target.check(data)

        atheris.Setup(command, check)
        atheris.Fuzz()
    return 0


def _fuzz_plain(arguments: argparse.Namespace) -> int:
    from fuzz_target import HANG_S, all_targets

    _limit_memory()
    target = all_targets()[arguments.target[0]]
    draw, state = random.Random(arguments.seed), State(arguments.child)
    seeds = list(target.seeds())
    for seed in seeds:
        target.check(seed)
    end = time.monotonic() + (float("inf") if arguments.seconds is None else arguments.seconds)
    most = float("inf") if arguments.inputs is None else arguments.inputs
    count, accepted, kinds = 0, 0, Counter[str]()
    while count < most and time.monotonic() < end:
        data, kind = target.mutated(draw.choice(seeds), draw), ""
        count += 1
        state.note(count, accepted, data)
        # Ends the process, also within a library, unless the input is done before.
        signal.setitimer(signal.ITIMER_PROF, KILLED_AFTER_S)
        start = time.process_time()
        try:
            accepted += target.check(data)
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            kind = f"{type(error).__name__} in {last.filename}:{last.lineno}"
        used = time.process_time() - start
        signal.setitimer(signal.ITIMER_PROF, 0)
        if not kind and used > HANG_S:
            kind = _SLOW
        if kind:
            kinds[kind] += 1
            if kinds[kind] <= KEPT:
                _keep(arguments.findings, data)
    state.note(count, accepted, b"")
    for kind, number in kinds.items():
        print(f"{number} times {kind}")
    return 0 if not kinds else SLOW_STATUS if set(kinds) == {_SLOW} else 1


def _limit_memory() -> None:
    limit = MEMORY_MB << 20
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


if __name__ == "__main__":
    # What readers say about odd input is not looked at here, and there is much of it.
    logging.getLogger("mtpgo").setLevel(logging.ERROR)
    sys.exit(main())
