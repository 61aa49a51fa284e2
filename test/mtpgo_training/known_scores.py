# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Score tables of agents whose errors are known, and the JSON content of such a table."""

import dataclasses
import functools

import numpy as np

from mtpgo_core.schema import AgentClass
from mtpgo_training.data.manoeuvres import MANOEUVRES
from mtpgo_training.evaluation.scores.agent_scores import ScoredAgents, score_agents
from mtpgo_training.evaluation.scores.bootstrap import over_groups
from mtpgo_training.evaluation.scores.score_summary import breakdowns
from mtpgo_training.evaluation.scores.score_table import ScoreTable

H = 5
KEEP, STANDS, TURNS = (
    1 << MANOEUVRES.index(name) for name in ("lane_keep", "standing", "turning")
)


def add(
    table,
    error,
    recording="01",
    model="m",
    *,
    n=4,
    kind=AgentClass.CAR,
    bits=KEEP,
    known=H,
    speed=10.0,
    site="",
    spread=1.0,
    step_s=0.2,
    since_start_s=np.nan,
    protocol="all",
):
    """Add n agents whose one mode is ``error`` metres off, with ``spread`` as standard deviation.

    ``error`` is one for all steps or [H]; a ``spread`` of None is no covariance.
    """
    truth = np.zeros((n, H, 2))
    mean = np.zeros((n, 1, H, 2))
    mean[..., 1] = error
    covariance = None if spread is None else np.tile(spread**2 * np.eye(2), (n, 1, H, 1, 1))
    mask = np.tile(np.arange(H) < known, (n, 1))
    agents = dataclasses.replace(
        ScoredAgents.unknown(n),
        recording=recording,
        site=site,
        step_s=step_s,
        agent_class=np.full(n, kind, np.uint8),
        manoeuvres=np.full(n, bits, np.uint8),
        speed_mps=np.full(n, speed),
        since_start_s=since_start_s,
    )
    scores = score_agents(mean, np.ones((n, 1)), covariance, truth, mask)
    table.add(model, protocol, scores, agents)


def filled():
    """Three recordings with one model, and constant velocity 4 m off."""
    table = ScoreTable()
    add(table, 1.0, "01", n=4)
    add(table, 2.0, "02", n=2, kind=AgentClass.TRUCK, bits=STANDS)
    add(table, 4.0, "03", n=2, known=3, bits=0)
    for recording, n in (("01", 4), ("02", 2), ("03", 2)):
        add(table, 4.0, recording, "cv", n=n)
    return table


@functools.cache
def json_content():
    """Return the scores of two seeds and constant velocity, 1, 2 and 4 m off, on two recordings.

    It is computed once for all tests, which must not change it.
    """
    table = ScoreTable()
    for model, error in (("x-seed1", 1.0), ("x-seed2", 2.0), ("cv", 4.0)):
        for recording, factor in (("01", 1.0), ("02", 1.5)):
            spread = None if model == "cv" else 1.0
            add(table, error * factor, recording, model, n=3, spread=spread)
    models = table.averages()
    return {
        "models": models,
        **breakdowns(table),
        "baselines": ["cv", "ca", "ctrv"],
        "seeds": over_groups(models, {"x": ["x-seed1", "x-seed2"]}),
        "recordings": {"01": "a", "02": "b"},
        "agreement": {},
        "live": {},
        "warnings": ["x-seed1 was trained on 01"],
    }
