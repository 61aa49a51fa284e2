# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Processor time of the live calibration: observations at 25 Hz, predictions at 5 Hz."""

from __future__ import annotations

import argparse
import dataclasses
import time

import numpy as np

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.live_calibration.live_calibration import LiveCalibration
from mtpgo_core.live_calibration.live_options import PREFERENCES, LiveOptions
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.schema import AgentClass, Source, tracked_states
from mtpgo_core.task.task_description import HistoryConfig

FRAME_HZ, EVERY, WARM_S, MODES, STEPS = 25, 5, 10.0, 8, 25


def measure(agents: int, seconds: float, prefer: str) -> str:
    """Return the shares of a core that observing and serving need, as text."""
    config, rng = HistoryConfig(), np.random.default_rng(0)
    history, live = (
        TrackHistory(config),
        LiveCalibration(LiveOptions(prefer=prefer), config, STEPS),
    )
    key, row = keys_from_integers(range(1, agents + 1)), np.arange(agents)
    observe_s = serve_s = 0.0
    for frame in range(round(seconds * FRAME_HZ)):
        time_s = frame / FRAME_HZ
        position = np.stack([12.0 * row + 10.0 * time_s, 3.5 * (row % 4)], axis=1)
        states = tracked_states(
            10**18 + round(time_s * 1e9),
            "map",
            key,
            position + rng.normal(scale=0.3, size=(agents, 2)),
            agent_class=np.full(agents, AgentClass.CAR, dtype=np.uint8),
            velocity=np.tile([10.0, 0.0], (agents, 1)),
        )
        report = history.update(states)
        start = time.process_time()
        live.observe(history, report)
        middle = time.process_time()
        observe_s += (middle - start) * (time_s >= WARM_S)
        if frame % EVERY:
            continue
        window = history.window()
        constant = predict_constant_velocity(window, horizon_steps=STEPS, dt_s=0.2, modes=MODES)
        source = np.full(agents, Source.MODEL, dtype=np.uint8)
        start = time.process_time()
        live.serve(dataclasses.replace(constant, source=source), window)
        serve_s += (time.process_time() - start) * (time_s >= WARM_S)
    measured_s = seconds - WARM_S
    cycle_ms = 1e3 * serve_s * EVERY / (measured_s * FRAME_HZ)
    return (
        f"{agents} road users, prefer {prefer}: observing {100 * observe_s / measured_s:.1f} % of"
        f" a core, serving {100 * serve_s / measured_s:.1f} % ({cycle_ms:.2f} ms a prediction)"
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--agents", type=int, default=64)
    parser.add_argument("--seconds", type=float, default=40.0)
    args = parser.parse_args()
    for prefer in PREFERENCES:
        print(measure(args.agents, args.seconds, prefer))


if __name__ == "__main__":
    main()
