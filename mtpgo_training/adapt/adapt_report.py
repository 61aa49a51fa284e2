# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What an adaptation changed, as text, and the refusal of one that made the model worse."""

from __future__ import annotations

import math

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.adapt.adaptation import Adaptation
from mtpgo_training.adapt.adaptation_scores import SiteScores

LEAST_COVERAGE = 0.85
"""Share of the moving road users of the validation part in the 90 % ellipses below which a warning
says so; chosen: on other recordings of the site it is up to .07 less (measured)."""


def report_text(adaptation: Adaptation, minutes: float) -> str:
    """Return three lines: the errors, the coverage, and what was trained on.

    Args:
        adaptation: the finished adaptation.
        minutes: that it took (min).
    """
    before, after = adaptation.before, adaptation.after
    change = 100.0 * (after.ade_m / before.ade_m - 1.0)
    times = "/".join(f"{time:g}" for time in before.coverage_90)
    return "\n".join(
        (
            f"ADE        {before.ade_m:.3f} -> {after.ade_m:.3f} m ({change:+.0f} %) of moving "
            f"road users, constant velocity {before.constant_velocity_ade_m:.3f} m; "
            f"NLL {before.nll:.2f} -> {after.nll:.2f}",
            f"in 90 %    {_shares(before)} -> {_shares(after)} of moving road users at {times} s",
            f"trained on {adaptation.train_minutes:.1f} min of {adaptation.train_recordings} "
            f"recording(s), {adaptation.train_agents} road users, {_epochs(adaptation)}, "
            f"{adaptation.share:.0%} of the change kept, in {minutes:.1f} min",
        )
    )


def _epochs(adaptation: Adaptation) -> str:
    """Return how many epochs there were, and whose weights were taken."""
    done, wanted, best = adaptation.epochs, adaptation.wanted_epochs, adaptation.best_epoch
    text = f"{done} epochs"
    if done < wanted and adaptation.received_signal is None:
        text = f"{done} of {wanted} epochs fitted into --minutes"
    if not best:
        return f"{text}, those within the first kept"
    return f"{text}, best {best}" + (" (not completed)" if best > done else "")


def coverage_warning(adaptation: Adaptation) -> str:
    """Return a sentence where the adapted model's ellipses are too small, empty if they are not.

    Args:
        adaptation: the finished adaptation.
    """
    low = {
        f"{time:g}": share
        for time, share in adaptation.after.coverage_90.items()
        if share < LEAST_COVERAGE  # never of a share that is not known
    }
    if not low:
        return ""
    return (
        f"the 90 % ellipses of the adapted model hold "
        f"{'/'.join(f'{share:.2f}' for share in low.values())} of the moving road users "
        f"{'/'.join(low)} s ahead, expected at least {LEAST_COVERAGE:.2f}: adapt with more "
        "recordings or more --minutes"
    )


def require_better(adaptation: Adaptation) -> None:
    """Check that the adapted model is no worse than the one it began with.

    Raises:
        ConfigurationError: its ADE of moving road users or its likelihood on the validation
            part is worse.
    """
    before, after = adaptation.before, adaptation.after
    if after.ade_m <= before.ade_m and after.nll <= before.nll:
        return
    raise ConfigurationError(
        f"the adapted model is worse than the one it began with on the validation part "
        f"(ADE of moving road users {before.ade_m:.3f} -> {after.ade_m:.3f} m, NLL "
        f"{before.nll:.3f} -> {after.nll:.3f}), expected no worse; --force writes it anyway"
    )


def _shares(scores: SiteScores) -> str:
    return "/".join(
        "-" if math.isnan(share) else f"{share:.2f}" for share in scores.coverage_90.values()
    )
