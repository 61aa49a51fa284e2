# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The claim protocol of a request."""

import threading

from mtpgo_ros.node.inference.prediction_request import PredictionRequest


def test_only_the_first_claim_succeeds():
    request = PredictionRequest("window", 1, received_ns=100, budget_ns=20, deadline_ns=40)
    assert request.due_ns == 120
    assert not request.claimed
    assert request.claim()
    assert request.claimed
    assert not request.claim()


def test_of_many_threads_one_gets_the_claim():
    for _ in range(50):
        request = PredictionRequest("window", 1, 0, 1, 1)
        start, successes = threading.Barrier(8), []

        def claim(request=request, start=start, successes=successes):
            start.wait()
            if request.claim():
                successes.append(1)

        threads = [threading.Thread(target=claim) for _ in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(successes) == 1
