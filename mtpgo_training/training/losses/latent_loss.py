# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The objective of Trajectron++ (Salzmann et al., ECCV 2020, eq. 3), with its annealed weight."""

from __future__ import annotations

import math
from collections.abc import Mapping

from torch import Tensor

from models.baselines.latent.trajectron_plus_plus import TrajectronPlusPlus
from mtpgo_training.training.losses.huber_terms import NO_TERMS, HuberTerms
from mtpgo_training.training.losses.likelihood_loss import trajectory_log_prob


def latent_loss(
    model: TrajectronPlusPlus,
    fields: Mapping[str, Tensor],
    *,
    progress: float,
    huber: HuberTerms = NO_TERMS,
) -> Tensor:
    """Return -(E_q[log p(y | x, z)] - beta KL(q(z | x, y) || p(z | x)) + alpha I(x; z)), a scalar.

    z has few values, so the expectation is a sum over all of them and nothing is drawn. An average
    over the observed agent-steps, as the other losses.

    Not in the publication are the Huber losses that may be added. Without them, in a training of
    minutes, values of z become degrees of uncertainty: those with wide covariances are likely
    where the future is uncertain, and their means hardly learn, since the likelihood's gradient is
    divided by the variance. So the heaviest component is a poor prediction.

    Args:
        model: the network.
        fields: a batch from :func:`mtpgo_training.scenes.scene_dataset.dense`.
        progress: share of the training that is done, which determines beta.
        huber: added to the objective; by default nothing, as in the publication.
    """
    target, mask = fields["target"][..., :2], fields["weight"]
    context, start = model.encode(fields["x"], fields["valid"], fields["static"])
    wheeled = model.is_wheeled(fields["static"])
    mean, covariance = model.decode(context, start, wheeled, with_covariance=True)
    log_prior = model.mixture(context)
    log_posterior = model.log_posterior(context, start, target, mask > 0.0)
    log_prob = trajectory_log_prob(mean, covariance, target, mask)
    expected = (log_posterior.exp() * log_prob).sum(dim=-1)
    config = model.options
    beta = annealed(config.kl_weight, progress, config.kl_centre, config.kl_width)
    weight = mask.amax(dim=-1)
    bound = (expected - beta * divergence(log_posterior, log_prior)) * weight
    information = mutual_information(log_prior, weight) * weight.sum()
    gain = bound.sum() + config.information_weight * information
    return -gain / mask.sum().clamp(min=1e-6) + huber(log_prior, mean, target, mask)


def divergence(log_q: Tensor, log_p: Tensor) -> Tensor:
    """Return [...] the Kullback-Leibler divergence KL(q || p) of categorical [..., M] (nats)."""
    return (log_q.exp() * (log_q - log_p)).sum(dim=-1)


def mutual_information(log_p: Tensor, weight: Tensor) -> Tensor:
    """Return the mutual information of agent and z, a scalar (nats).

    The entropy of the average distribution less the average entropy: large where each agent is
    sure of its z and all values of z are used.

    Args:
        log_p: [B, N, M] log p(z | x).
        weight: [B, N] of the agents.
    """
    share = (weight / weight.sum().clamp(min=1e-6)).unsqueeze(-1)
    average = (share * log_p.exp()).sum(dim=(0, 1))
    entropy = -(average * average.clamp(min=1e-12).log()).sum()
    return entropy + (share * log_p.exp() * log_p).sum()


def annealed(final: float, progress: float, centre: float, width: float) -> float:
    """Return a weight that rises to ``final`` along a sigmoid.

    Args:
        final: its last value.
        progress: share of the training, 0 to 1.
        centre: share at which it is half of ``final``.
        width: share in which the sigmoid's argument grows by one.
    """
    return final / (1.0 + math.exp(-(progress - centre) / width))
