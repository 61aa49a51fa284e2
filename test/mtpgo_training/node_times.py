# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Times as the load generator of the node's benchmark records them."""

MS = 1_000_000
STEP, PERIOD = 40 * MS, 200 * MS  # 25 Hz in, 5 Hz out
STAMP = 10**18  # stamps and the monotonic clock differ


def made(latency_ms, *, lost=(), fallback=(), seconds=3.0, measured=(1.0, 3.0)):
    """Return observations at 25 Hz and predictions of every fifth, except for ``lost`` cycles."""
    published = [[STAMP + k * STEP, k * STEP] for k in range(int(seconds * 25))]
    received = [
        [stamp, when + round(latency_ms(n) * MS), 4, 4 if n in fallback else 0]
        for n, (stamp, when) in enumerate(published[::5])
        if n not in lost
    ]
    return {
        "published": published,
        "received": received,
        "heard_from_stamp": STAMP,
        "measured_from": round(measured[0] * 1e9),
        "measured_until": round(measured[1] * 1e9),
    }
