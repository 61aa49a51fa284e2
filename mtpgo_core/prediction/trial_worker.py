# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The process that tries model files; see :mod:`mtpgo_core.task.model_trial`.

Reads a line of JSON and the bytes of a file from stdin, writes a line of JSON to stdout: what is
wrong with the file, an empty text if nothing is.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import time
from pathlib import Path

_SCENES = (1, 8, 32)
"""Numbers of agents that a model is tried with."""


def main() -> None:
    """Answer until stdin ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what libraries print must not mix with the answers
    requests = sys.stdin.buffer
    from mtpgo_core.prediction.model_runner import ModelRunner
    from mtpgo_core.task.model_file import model_of

    while line := requests.readline():
        head = json.loads(line)
        data = requests.read(head["size"])
        _limit(head["seconds"], head["megabytes"])
        path = head["path"]
        try:
            ModelRunner.of(model_of(Path(path), data)).warm_up(_SCENES)
            reason = ""
        except MemoryError:
            reason = f"needs more than {head['megabytes']} MB of memory"
        except Exception as error:  # every error of a foreign file is an answer
            reason = " ".join(str(error).split()) or type(error).__name__
            reason = reason.removeprefix(f"model file {path} ")
        answers.write(json.dumps(reason) + "\n")
        answers.flush()


def _limit(seconds: int, megabytes: int) -> None:
    """Limit the processor time and the memory from now on."""
    used_s = int(time.process_time()) + 1
    _, most = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (used_s + seconds, most))
    pages = int(Path("/proc/self/statm").read_text().split()[5])
    used = pages * resource.getpagesize()
    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (used + (megabytes << 20), most))


if __name__ == "__main__":
    main()
