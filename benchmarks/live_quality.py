# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Measure what the node's live scores cost: processor time and memory, in one process.

Observations come at 25 Hz and predictions of eight modes and 25 steps at 5 Hz. The scores are read
once a second and turned into a message, as in the node. The same stream without scores is
subtracted.
"""

import argparse
import time

import numpy as np

from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.outputs.quality_table import quality_to_array
from msg_adapters.types import TypestoreTypes
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.quality.quality_report import QualityLimits, judge
from mtpgo_core.schema import tracked_states
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_ros.quality.live_quality import LiveQuality

SECONDS, WARM_UP_S, INPUT_HZ, EVERY = 90, 10, 25, 5


def run(agents: int, turnover: float, quality: LiveQuality | None) -> float:
    """Return the processor time of a stream, per second of it (s)."""
    config = HistoryConfig()
    history = TrackHistory(config)
    types, limits = TypestoreTypes(bag_typestore()), QualityLimits()
    rows = np.arange(agents)
    began_s = 0.0
    for step in range(SECONDS * INPUT_HZ):
        if step == WARM_UP_S * INPUT_HZ:
            began_s = time.process_time()
        time_s = step / INPUT_HZ
        age = ((time_s * turnover + rows) // agents).astype(int)
        position = np.stack([15.0 * time_s + 0.0 * rows, 4.0 * rows + 500.0 * (age % 2)], axis=1)
        states = tracked_states(
            round((100.0 + time_s) * 1e9),
            "map",
            keys_from_integers((rows + agents * age).tolist()),
            position,
            velocity=np.tile([15.0, 0.0], (agents, 1)),
            agent_class=np.ones(agents, dtype=np.uint8),
        )
        report = history.update(states)
        if quality is not None:
            quality.observed(history, report)
        if step % EVERY == 0:
            window = history.window()
            window = window.select(window.valid[:, -1])
            prediction = predict_constant_velocity(window, horizon_steps=25, dt_s=0.2, modes=8)
            if quality is not None:
                quality.published(prediction, window, 8)
        if step % INPUT_HZ == 0 and quality is not None:
            scores = quality.report()
            judge(scores, limits, 300)
            quality_to_array(scores.rows(limits), types)
    return (time.process_time() - began_s) / (SECONDS - WARM_UP_S)


def main() -> None:
    """Print the processor time and the memory."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    add = parser.add_argument
    add("--agents", type=int, default=64, metavar="N", help="road users (64)")
    add(
        "--turnover", type=float, default=2.0, metavar="N", help="road users replaced a second (2)"
    )
    options = parser.parse_args()
    quality = LiveQuality(HistoryConfig())
    without_s = run(options.agents, options.turnover, None)
    share = run(options.agents, options.turnover, quality) - without_s
    size = quality._matcher.memory.bytes + quality._scores.bytes
    print(f"{options.agents} road users: {100.0 * share:.2f} % of a core, {size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
