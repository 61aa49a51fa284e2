# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The grid of segments: everything beside a place is found, and little else."""

import numpy as np

from mtpgo_core.scene.segment_grid import CELL_M, SegmentGrid


def segments(number=300, seed=0):
    draw = np.random.default_rng(seed)
    start = draw.uniform(-200.0, 200.0, (number, 2))
    along = draw.normal(size=(number, 2)) * draw.choice([0.5, 5.0, 120.0], (number, 1))
    return start, along


def test_every_segment_that_a_lateral_line_meets_is_found():
    start, along = segments()
    grid = SegmentGrid(start, along)
    draw = np.random.default_rng(1)
    point = draw.uniform(-220.0, 220.0, (200, 2))
    angle = draw.uniform(-np.pi, np.pi, 200)
    sideways = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    who, segment = grid.beside(point, sideways, 40.0)
    assert (np.diff(who) >= 0).all()
    found = set(zip(who.tolist(), segment.tolist(), strict=True))
    # By Cramer's rule: point + s * sideways == start + t * along.
    to_start = start[None] - point[:, None]
    cross = sideways[:, None, 0] * along[:, 1] - sideways[:, None, 1] * along[:, 0]
    s = (to_start[..., 0] * along[:, 1] - to_start[..., 1] * along[:, 0]) / cross
    t = (to_start[..., 0] * sideways[:, None, 1] - to_start[..., 1] * sideways[:, None, 0]) / cross
    met = {(int(p), int(q)) for p, q in np.argwhere((abs(s) <= 40.0) & (t >= 0.0) & (t <= 1.0))}
    assert len(met) > 100
    assert met <= found
    assert len(found) < 0.2 * len(point) * len(start)


def test_far_from_all_segments_there_is_none():
    start, along = segments(20)
    grid = SegmentGrid(start, along)
    who, _ = grid.beside(np.array([[1e6, 0.0], [-1e6, 3.0]]), np.array([[0.0, 1.0]] * 2), 40.0)
    assert len(who) == 0
    assert abs(grid.distance_m(np.array([[1e6, 0.0]])) - 1e6) < 1000.0


def test_the_distance_is_at_most_a_cell_too_small():
    start, along = np.array([[0.0, 0.0]]), np.array([[100.0, 0.0]])
    distance = SegmentGrid(start, along).distance_m(np.array([[50.0, 500.0], [50.0, 900.0]]))
    assert 500.0 - CELL_M <= distance <= 500.0


def test_lines_too_long_for_a_grid_are_recognised():
    assert SegmentGrid.fits(np.array([[1e6, 0.0]]))
    assert not SegmentGrid.fits(np.array([[1e9, 0.0]]))
