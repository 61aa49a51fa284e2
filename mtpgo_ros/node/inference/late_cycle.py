# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where the time of a prediction went that missed its deadline."""

from __future__ import annotations

from mtpgo_ros.node.inference.prediction_request import PredictionRequest


def late_cycle(request: PredictionRequest, published_ns: int) -> str:
    """Return a sentence with the stages of a request, for the log.

    The processor's time of the model tells a slow model from a machine that was busy with others.

    Args:
        request: with the times that it has been through.
        published_ns: when its answer was published (ns of the monotonic clock).
    """
    last_ns = request.submitted_ns or request.received_ns
    stages = [f"{_ms(last_ns - request.received_ns)} in the input"]
    if request.begun_ns:
        stages.append(f"{_ms(request.begun_ns - last_ns)} until the model began")
        last_ns = request.begun_ns
    if request.predicted_ns:
        computed = f"{_ms(request.computed_ns)} of it on a processor"
        stages.append(f"{_ms(request.predicted_ns - last_ns)} in the model, {computed}")
        last_ns = request.predicted_ns
    elif request.begun_ns:
        stages.append("the model still at work")
    stages.append(f"{_ms(published_ns - last_ns)} until it was published")
    return (
        f"deadline missed: a prediction came {_ms(published_ns - request.received_ns)} after its "
        f"observation, expected within {_ms(request.deadline_ns)} ({'; '.join(stages)})"
    )


def _ms(time_ns: int) -> str:
    return f"{time_ns * 1e-6:.0f} ms"
