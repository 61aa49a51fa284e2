# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The demo's report."""

from mtpgo_training.demo.demo_page import write_demo_page

RECORDING = {
    "scenes": 40,
    "agents_max": 2,
    **dict.fromkeys(("ade_m", "fde_m", "miss_rate", "nll"), 0.5),
    **{f"coverage_90_moving_{t}s": 0.5 for t in (1, 3, 5)},
    **dict.fromkeys(("cv_ade_m", "cv_fde_m", "cv_miss_rate", "cv_nll"), 0.75),
}
CONTENT = RECORDING | {
    "recordings": {"01": RECORDING, "02": RECORDING},
    "model": {"name": "made", "weights_sha256": "0123456789abcdef0123"},
    "versions": {"python": "3.11"},
    "cycles": 40,
    "missed_cycles": 0,
    "late_predictions": 0,
    "predictions_published": 80,
    "missing_predictions": 0,
    "fallback_predictions": 0,
    "latency_ms_p50": None,
    "live": [],
    "calibration": {},
}


def live_row(time_s):
    scores = dict.fromkeys(("ade", "fde", "cv_ade", "nll", "coverage_50", "coverage_90"), 0.625)
    side = {"agents": 3, "predictions": 20} | scores
    row = {"window_s": 1800, "group": "vehicle_moving", "time_s": time_s}
    return row | {"live": side, "offline": side}


def test_the_page_has_what_is_printed_and_its_figures(tmp_path):
    moving = {f"coverage_90_moving_{t}s": 0.8 for t in (1, 3, 5)}
    effect = {"shipped": moving | {"anll": 1.25}, "online": moving | {"anll": 1.125}}
    live = [live_row(t) for t in (1, 3, 5)]
    page = write_demo_page(CONTENT | {"live": live, "calibration": effect}, 5.0, tmp_path / "new")
    text = page.read_text()
    assert {path.stem for path in page.parent.glob("*.png")} == {
        "live_coverage",
        "live_error",
        "calibration_effect",
    }
    for part in ("moving vehicle, 5 s", "0.625", "1.12", "40 of 40 cycles", "0.000 mm at most"):
        assert part in text, part


def test_a_node_that_scored_nothing_has_a_page_of_results(tmp_path):
    page = write_demo_page(CONTENT, 5.0, tmp_path)
    text = page.read_text()
    assert "Results" in text
    assert "Live scores" not in text
    assert not list(tmp_path.glob("*.png"))
