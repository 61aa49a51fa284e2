# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The grid of the social poolings, worked by hand."""

import torch
from baseline_samples import GRID

from models.baselines.social_grid import Grid


def test_the_grid_by_hand():
    """The agent heads along y: seven metres ahead is one row on, five to its left a column."""
    position = torch.tensor([[[0.0, 0.0], [0.0, 7.0], [-5.0, 0.0], [2.0, -4.0], [0.0, 22.0]]])
    direction = torch.tensor([0.0, 1.0]).expand(1, 5, 2)
    present = torch.ones(1, 5, dtype=torch.bool)
    cell = Grid(GRID)(position, direction, present)
    middle = 3 * 3 + 1
    assert cell[0, 0].tolist() == [21, middle + 3, middle + 1, middle - 3, 21]


def test_an_agent_on_a_line_between_cells_is_in_the_one_ahead_or_to_the_left():
    """The middle cell reaches 3 m ahead and behind, 2 m to either side."""
    position = torch.tensor([[[0.0, 0.0], [3.0, 0.0], [-3.0, 0.0], [0.0, 2.0], [0.0, -2.0]]])
    direction = torch.tensor([1.0, 0.0]).expand(1, 5, 2)
    cell = Grid(GRID)(position, direction, torch.ones(1, 5, dtype=torch.bool))
    middle = 3 * 3 + 1
    assert cell[0, 0].tolist() == [21, middle + 3, middle, middle + 1, middle]


def test_absent_agents_are_in_no_cell_and_own_no_grid():
    present = torch.tensor([[True, False, True]])
    direction = torch.tensor([1.0, 0.0]).expand(1, 3, 2)
    cell = Grid(GRID)(torch.zeros(1, 3, 2), direction, present)
    assert cell.tolist() == [[[21, 21, 10], [21, 21, 21], [10, 21, 21]]]


def test_rows_of_the_table_by_hand():
    """Two scenes of two agents, 21 cells each; 84 is the number after the last row."""
    cell = torch.tensor([[[21, 3], [5, 21]], [[21, 0], [20, 21]]])
    grid = Grid(GRID)
    assert grid.rows_of(cell, owner=True).tolist() == [
        [[84, 3], [21 + 5, 84]],
        [[84, 42], [63 + 20, 84]],
    ]
    assert grid.rows_of(cell, owner=False).tolist() == [
        [[84, 21 + 3], [5, 84]],
        [[84, 63], [42 + 20, 84]],
    ]
