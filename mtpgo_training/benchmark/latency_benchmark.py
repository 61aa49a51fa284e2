# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Time of one prediction: the exported model and the reference implementation in turns."""

from __future__ import annotations

import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.utils.flop_counter import FlopCounterMode
from tqdm import tqdm

from models import MTPGO, ModelConfig
from models.inference import deployable
from mtpgo_core.errors import ModelFileError
from mtpgo_core.task.torchscript import torchscript
from mtpgo_training.benchmark.measurement.machine import print_heading, table, write_json
from mtpgo_training.benchmark.reference_mtp_go import ReferenceMTPGO
from mtpgo_training.training.torch_process import prepare_process

Inputs = tuple[Tensor, Tensor, Tensor]

LARGEST_DIFFERENCE_M = 1e-4
"""Largest difference of the two implementations' means; more is an error, not a result."""

TURNS = 5
"""Predictions of the exported model per prediction of the other."""

LEAST_ROUNDS = 5


COLUMNS = {
    "agents": "{.agents}",
    "threads": "{.threads}",
    "median ms": "{.median_ms:.1f}",
    "p99 ms": "{.p99_ms:.1f}",
    "straightforward ms": "{.baseline_median_ms:.0f}",
    "ratio": "{.ratio:.1f}",
    "MFLOP": "{.mflop:.0f}",
    "of GEMM": "{.gemm_share:.0%}",
}
"""Heading and format of each column of the printed table."""


@dataclass(frozen=True)
class LatencyRow:
    """One line of the table.

    Attributes:
        agents: N of one complete graph.
        threads: of torch.
        median_ms: of the exported model.
        p99_ms: 99th percentile of the exported model.
        baseline_median_ms: of the straightforward implementation.
        ratio: of the medians.
        mflop: of the matrix products in the equations.
        gemm_share: their rate as a share of the measured rate of a large matrix product.
        difference_m: largest difference between the means (m).
    """

    agents: int
    threads: int
    median_ms: float
    p99_ms: float
    baseline_median_ms: float
    ratio: float
    mflop: float
    gemm_share: float
    difference_m: float


def make_model(seed: int = 0) -> MTPGO:
    """Return the default model, untrained but with a nonlinear motion model."""
    torch.manual_seed(seed)
    model = MTPGO(ModelConfig()).eval().requires_grad_(False)
    with torch.no_grad():
        model.motion.last.normal_(0.0, 0.3)
        model.control.out.weight.mul_(30.0)
    return model


def make_scene(agents: int, config: ModelConfig, seed: int = 0) -> Inputs:
    """Return features [1, N, T, F], presence and classes of agents driving in all directions."""
    draw = torch.Generator().manual_seed(seed)
    time_s = config.dt_s * torch.arange(1 - config.history_steps, 1)
    angle = 6.3 * torch.rand(agents, 1, generator=draw) + 0.1 * time_s
    speed = 5.0 + 10.0 * torch.rand(agents, 1, generator=draw)
    velocity = speed.unsqueeze(-1) * torch.stack((angle.cos(), angle.sin()), dim=-1)
    place = 30.0 * torch.randn(agents, 1, 2, generator=draw)
    features = torch.zeros(1, agents, config.history_steps, config.feature_size)
    features[0, ..., :2] = place + velocity * time_s.unsqueeze(-1)
    features[0, ..., 2:4] = velocity
    features[0, ..., 4:6] = torch.randn(agents, config.history_steps, 2, generator=draw)
    features[0, ..., 6:8] = torch.stack((angle.cos(), angle.sin()), dim=-1)
    static = torch.zeros(1, agents, config.static_size)
    static[..., 0] = 1.0
    return features, torch.ones(1, agents, config.history_steps, dtype=torch.bool), static


def exported(model: MTPGO) -> torch.jit.ScriptModule:
    """Return the model after a round trip through a file, as the node loads it."""
    with torchscript(), tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder, "model.pt"))
        torch.jit.save(torch.jit.freeze(torch.jit.script(deployable(model))), path)
        return torch.jit.load(path).eval()


def matrix_mflop(model: MTPGO, scene: Inputs) -> float:
    """Return the millions of floating point operations of the model's matrix products."""
    with torch.no_grad(), FlopCounterMode(display=False) as counter:
        model(*scene)
    return counter.get_total_flops() / 1e6


def gemm_gflops(size: int = 768, seconds: float = 0.5) -> float:
    """Return the best rate of one large float32 matrix product (GFLOP/s)."""
    a, b = torch.randn(2, size, size)
    out = torch.empty(size, size)
    best, until = float("inf"), time.perf_counter() + seconds
    while time.perf_counter() < until:
        begin = time.perf_counter()
        torch.mm(a, b, out=out)
        best = min(best, time.perf_counter() - begin)
    return 2.0 * size**3 / best / 1e9


def largest_difference_m(one: tuple[Tensor, ...], other: tuple[Tensor, ...]) -> float:
    """Return the largest difference between the positions of two predictions (m)."""
    return float((one[1][..., :2] - other[1][..., :2]).abs().max())


def measure(agents: int, seconds: float, peak_gflops: float) -> LatencyRow:
    """Measure both implementations in turns.

    Args:
        agents: N.
        seconds: how long; at least five rounds.
        peak_gflops: of :func:`gemm_gflops`.

    Raises:
        ModelFileError: the implementations do not agree.
    """
    model = make_model()
    scene = make_scene(agents, model.config)
    ours, plain = exported(model), ReferenceMTPGO(model.config, model.state_dict())
    fast_s: list[float] = []
    plain_s: list[float] = []
    # As the node calls it; see mtpgo_core.prediction.model_runner.
    with torch.inference_mode(), torch.jit.optimized_execution(False):
        for _ in range(3):
            mine = ours(*scene)
    with torch.no_grad():
        theirs = plain(*scene)
    difference = largest_difference_m(mine, theirs)
    if not difference <= LARGEST_DIFFERENCE_M:
        raise ModelFileError(
            f"with {agents} agents the implementations differ by {difference:.1e} m, expected at "
            f"most {LARGEST_DIFFERENCE_M:.0e}"
        )
    until = time.perf_counter() + seconds
    while time.perf_counter() < until or len(plain_s) < LEAST_ROUNDS:
        begin = time.perf_counter()
        plain(*scene)
        plain_s.append(time.perf_counter() - begin)
        with torch.inference_mode(), torch.jit.optimized_execution(False):
            for _ in range(TURNS):
                begin = time.perf_counter()
                ours(*scene)
                fast_s.append(time.perf_counter() - begin)
    median, baseline = float(np.median(fast_s)), float(np.median(plain_s))
    mflop = matrix_mflop(model, scene)
    return LatencyRow(
        agents=agents,
        threads=torch.get_num_threads(),
        median_ms=1e3 * median,
        p99_ms=1e3 * float(np.percentile(fast_s, 99)),
        baseline_median_ms=1e3 * baseline,
        ratio=baseline / median,
        mflop=mflop,
        gemm_share=mflop / 1e3 / median / peak_gflops,
        difference_m=difference,
    )


def print_latency(
    agents: list[int], threads: list[int], seconds: float, output: Path | None, command: str
) -> list[LatencyRow]:
    """Measure, print the table and write it.

    Args:
        agents: numbers of agents.
        threads: numbers of threads.
        seconds: for each row.
        output: JSON file with the machine and ``rows``, or None.
        command: command line that repeats it.

    Raises:
        ConfigurationError: the file cannot be written.
    """
    print_heading(command, output)
    rows: list[LatencyRow] = []
    peaks: dict[int, float] = {}
    cases = [(count, number) for count in threads for number in agents]
    for count, number in tqdm(cases, unit="row", disable=None):
        prepare_process(count)
        if count not in peaks:
            peaks[count] = gemm_gflops()
        rows.append(measure(number, seconds, peaks[count]))
    print(table(rows, COLUMNS))
    for count, peak in peaks.items():
        print(f"large matrix product on {count} thread(s): {peak:.0f} GFLOP/s")
    peak_of = {str(count): peak for count, peak in peaks.items()}
    content = [asdict(row) for row in rows]
    write_json(output, {"command": command, "gemm_gflops": peak_of, "rows": content})
    return rows
