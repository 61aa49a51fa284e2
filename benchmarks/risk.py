# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Measure how long the risk of a prediction takes, and the occupancy grid, on one core.

Road users drive on a road of eight lanes around the ego, which drives among them; modes differ in
direction and acceleration.
"""

import argparse
import functools
import time
from collections.abc import Callable

import numpy as np

from msg_adapters.outputs.autoware_predictions import prediction_to_predicted_objects_bytes
from msg_adapters.predictions import prediction_from_predicted_objects
from mtpgo_core.frames import Pose2
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.risk.collision_risk import assess
from mtpgo_core.risk.ego_plan import EgoFootprint, plan_of_motion
from mtpgo_core.risk.predicted_occupancy import GridShape, predicted_occupancy
from mtpgo_core.schema import Prediction


def traffic(agents: int, modes: int, steps: int, reach_m: float, seed: int = 0) -> Prediction:
    """Return a prediction of road users within ``reach_m`` of the ego along the road."""
    rng = np.random.default_rng(seed)
    time_s = 0.2 * np.arange(1, steps + 1)
    x, y = rng.uniform(-reach_m, reach_m, agents), 3.5 * (rng.integers(0, 8, agents) - 3.5)
    opposite = y > 0.0
    yaw = np.where(opposite, np.pi, 0.0)[:, None] + rng.normal(0.0, 0.08, (agents, modes))
    speed, faster = rng.uniform(5.0, 20.0, (agents, 1, 1)), rng.normal(size=(agents, modes, 1))
    way = speed * time_s + 0.5 * faster * time_s**2
    c, s = np.cos(yaw)[..., None], np.sin(yaw)[..., None]
    mean = np.zeros((agents, modes, steps, 4))
    mean[..., 0], mean[..., 1] = x[:, None, None] + c * way, y[:, None, None] + s * way
    along, across = (0.2 + 0.3 * time_s**1.3) ** 2, (0.1 + 0.12 * time_s) ** 2
    covariance = np.zeros((agents, modes, steps, 2, 2))
    covariance[..., 0, 0] = along * c * c + across * s * s
    covariance[..., 1, 1] = along * s * s + across * c * c
    covariance[..., 0, 1] = covariance[..., 1, 0] = (along - across) * c * s
    return Prediction(
        stamp_ns=0,
        frame_id="map",
        key=keys_from_integers(range(agents)),
        agent_class=np.ones(agents, np.uint8),
        z=np.zeros(agents),
        size=np.tile([4.5, 1.8], (agents, 1)),
        initial=np.full((agents, 4), np.nan),
        initial_yaw=np.zeros(agents),
        time_s=time_s,
        weight=np.sort(rng.dirichlet(np.ones(modes), agents), axis=1)[:, ::-1],
        mean=mean,
        yaw=np.repeat(yaw[..., None], steps, axis=2),
        covariance=covariance,
        source=np.zeros(agents, np.uint8),
    )


def processor_ms(function: Callable[[], object], rounds: int) -> tuple[float, float]:
    """Return the least and the median processor time of calls (ms)."""
    taken = []
    for _ in range(rounds + 2):
        began_s = time.process_time()
        function()
        taken.append(1e3 * (time.process_time() - began_s))
    return min(taken[2:]), float(np.median(taken[2:]))


def main() -> None:
    """Print the times."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    add = parser.add_argument
    add("--agents", type=int, default=64, metavar="N", help="road users (64)")
    add("--modes", type=int, default=8, metavar="N", help="modes (8)")
    add("--steps", type=int, default=25, metavar="N", help="steps of 0.2 s (25)")
    add("--rounds", type=int, default=30, metavar="N", help="calls (30)")
    options = parser.parse_args()
    plan = plan_of_motion(0, "map", Pose2(0.0, 1.75, 0.0, velocity=(12.0, 0.0)))
    size = (options.agents, options.modes, options.steps)
    for reach_m in (50.0, 100.0, 200.0):
        given = traffic(*size, reach_m)
        call = functools.partial(assess, given, plan, EgoFootprint())
        least, median = processor_ms(call, options.rounds)
        share = np.mean(call().probability > 0.0)
        print(
            f"{options.agents} road users within {reach_m:.0f} m: {least:.1f} ms, median"
            f" {median:.1f} ms; {share:.0%} of the steps have a risk"
        )
    given = traffic(*size, 50.0)
    data = prediction_to_predicted_objects_bytes(given)
    call = functools.partial(prediction_from_predicted_objects, data, assume_covariance=True)
    least, median = processor_ms(call, options.rounds)
    print(f"reading them as PredictedObjects: {least:.1f} ms, median {median:.1f} ms")
    for end_s in (0.2, 2.0):
        call = functools.partial(predicted_occupancy, given, GridShape(), np.zeros(2), 0.0, end_s)
        least, _ = processor_ms(call, 3)
        print(f"occupancy of 100 m x 100 m up to {end_s:.1f} s: {least:.0f} ms")


if __name__ == "__main__":
    main()
