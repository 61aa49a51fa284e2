# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options of Trajectron++, in addition to those that all networks have."""

import math
from dataclasses import dataclass

from models.baselines.baseline_config import BaselineConfig
from mtpgo_core.options import option


@dataclass(frozen=True)
class TrajectronConfig(BaselineConfig):
    """Options of Trajectron++; the values of its discrete latent z are the ``modes``.

    Attributes:
        edge_hidden: channels of the encoded neighbours of one kind.
        future_hidden: channels of each direction of the LSTM over the true future (training).
        bandwidth_m: first value of the learned edge bandwidth (m), the weights of MTP-GO's eq. 13.
        wheeled_columns: columns of the static features that are classes with wheels, which move as
            unicycles; every other agent, one of unknown class included, is a single integrator.
            Follows from the task's classes.
        kl_weight: beta of eq. 3 at the end of the annealing.
        kl_centre: share of the training after which beta is half of that (chosen: until then the
            prior does not learn, and a short training had its heaviest mode wrong for longer).
        kl_width: share of the training that sets how slowly it rises around ``kl_centre``.
        information_weight: alpha of eq. 3, weight of the mutual information of x and z.
    """

    edge_hidden: int = option(16, low=1)
    future_hidden: int = option(32, low=1)
    bandwidth_m: float = option(30.0, above=0.0, below=math.inf)
    wheeled_columns: tuple[int, ...] = option((), low=0)
    kl_weight: float = option(1.0, low=0.0, below=math.inf)
    kl_centre: float = option(0.05, low=0.0, high=1.0)
    kl_width: float = option(0.02, above=0.0, below=math.inf)
    information_weight: float = option(1.0, low=0.0, below=math.inf)
