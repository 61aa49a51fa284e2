# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Models against the better of two simple motions, by class and motion."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pandas as pd

from mtpgo_training.evaluation.scores.score_table import scores_by
from mtpgo_training.scenes.kinematic_baselines import BASELINES

Json = dict[str, Any]

SIMPLE = ("cv", "ca")
"""The baselines that a model is compared with: constant velocity and acceleration."""

WORSE_BY = 0.02
"""Share by which a model may be worse than the better of the two; chosen: less is no difference
that a user would notice."""

_COLUMNS = ["protocol", "model", "agent_class", "motion"]


def is_worse(ade: float | None, simple: Iterable[float | None]) -> bool | None:
    """Return whether an ADE is more than :data:`WORSE_BY` above the smallest of simple motions.

    None if it is not known, or none of theirs is.
    """
    least = min((value for value in simple if value is not None), default=None)
    return None if ade is None or least is None else ade > (1.0 + WORSE_BY) * least


def compare_with_simple(agents: pd.DataFrame) -> Json:
    """Return by model, protocol and group (``CLASS, MOTION``) how a model stands to simple motion.

    ``n``, ``ade``, ``cv``, ``ca`` (m), ``ade_to_cv``, ``ade_to_ca``, and ``worse``: the ADE is
    more than :data:`WORSE_BY` above the better of the two. None for what is not defined.

    Args:
        agents: rows of ``ScoreTable.agents``.
    """
    found = scores_by(agents, _COLUMNS)
    content: Json = {}
    for (protocol, model, agent_class, motion), scores in found.items():
        if model in BASELINES or not scores["n"]:
            continue
        simple = {
            name: found.get((protocol, name, agent_class, motion), {}).get("ade")
            for name in SIMPLE
        }
        ade = scores["ade"]
        row: Json = {"class": agent_class, "motion": motion, "n": scores["n"], "ade": ade} | simple
        for name, value in simple.items():
            row[f"ade_to_{name}"] = ade / value if ade is not None and value else None
        row["worse"] = is_worse(ade, simple.values())
        place = content.setdefault(model, {}).setdefault(protocol, {})
        place[f"{agent_class}, {motion}"] = row
    return content
