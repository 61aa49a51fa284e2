# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predicted paths whose values of honesty are known."""

import dataclasses
import functools

import numpy as np

from mtpgo_core.schema import AgentClass
from mtpgo_training.evaluation.honesty.agent_honesty import PredictedPaths
from mtpgo_training.evaluation.honesty.honesty_summary import honesty_summary
from mtpgo_training.evaluation.honesty.honesty_table import HonestyTable
from mtpgo_training.evaluation.honesty.simple_comparison import compare_with_simple
from mtpgo_training.evaluation.scores.agent_scores import ScoredAgents, score_agents
from mtpgo_training.evaluation.scores.score_summary import breakdowns
from mtpgo_training.evaluation.scores.score_table import ScoreTable

H, DT = 25, 0.2
TIME = DT * np.arange(1, H + 1)


def agents(n, stamp_s=0.0, recording="01", kind=AgentClass.CAR, speed=10.0, bits=0, first=0):
    """Return n scored agents, tracks ascending from the first one's."""
    return dataclasses.replace(
        ScoredAgents.unknown(n),
        recording=recording,
        site="site",
        stamp_ns=round(stamp_s * 1e9),
        step_s=DT,
        track=first + np.arange(n),
        agent_class=np.full(n, kind, np.uint8),
        manoeuvres=np.full(n, bits, np.uint8),
        speed_mps=np.full(n, float(speed)),
        since_start_s=stamp_s,
    )


def paths(who, *, error_m=0.0, sigma_m=1.0, weight=(1.0,), apart_m=0.0, known=H, speed=10.0):
    """Return agents that drive to the right, side by side and 20 m apart, and their modes.

    The truth drives at ``speed``; mode i is ``error_m + i * apart_m`` to the left of it, with the
    standard deviation ``sigma_m`` on each axis (None for no covariance).
    """
    n, modes = len(who.track), len(weight)
    begin = np.stack([np.full(n, speed * who.stamp_ns * 1e-9), 20.0 * who.track], axis=-1)
    truth = begin[:, None] + np.stack([speed * TIME, 0.0 * TIME], axis=-1)
    mean = np.repeat(truth[:, None], modes, axis=1)
    mean[..., 1] += error_m + apart_m * np.arange(modes)[:, None]
    covariance = None
    if sigma_m is not None:
        covariance = np.tile(sigma_m**2 * np.eye(2), (n, modes, H, 1, 1))
    return PredictedPaths.of(
        who,
        size=np.full((n, 2), np.nan),
        start=np.concatenate([begin, np.tile([speed, 0.0], (n, 1))], axis=1),
        yaw=np.zeros(n),
        mean=mean,
        weight=np.tile(np.asarray(weight, dtype=float), (n, 1)),
        covariance=covariance,
        by_model=np.full(n, modes > 1),
        truth=truth,
        mask=np.tile(np.arange(H) < known, (n, 1)),
    )


@functools.cache
def honest_content():
    """Return the JSON content of a model with two modes and of constant velocity.

    Moving cars and standing pedestrians over four instants; it is computed once for all tests,
    which must not change it.
    """
    honesty, scores = HonestyTable(), ScoreTable()
    for k in range(4):
        cars = agents(3, 0.2 * k)
        walkers = agents(2, 0.2 * k, kind=AgentClass.PEDESTRIAN, speed=0.0, first=3)
        for name, error_m, weight in (("m", 3.0, (0.8, 0.2)), ("cv", 0.5 * k, (1.0,))):
            for who in (cars, walkers):
                given = paths(who, error_m=error_m, apart_m=-3.0, weight=weight)
                honesty.add(name, "all", who, given)
                scored = (given.mean, given.weight, given.covariance, given.truth, given.mask)
                scores.add(name, "all", score_agents(*scored), who)
    return {
        "models": scores.averages(),
        **breakdowns(scores),
        "honesty": honesty_summary(honesty),
        "groups": compare_with_simple(scores.agents()),
        "baselines": ["cv", "ca", "ctrv"],
    }
