# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Weights between two networks, by hand."""

import torch

from mtpgo_training.adapt.weight_averaging import between

BASE = {"weight": torch.tensor([1.0, 2.0]), "count": torch.tensor(3)}
TUNED = {"weight": torch.tensor([3.0, -2.0]), "count": torch.tensor(4)}


def test_a_share_of_the_way():
    torch.testing.assert_close(between(BASE, TUNED, 0.25)["weight"], torch.tensor([1.5, 1.0]))


def test_the_ends_are_the_networks_themselves():
    assert torch.equal(between(BASE, TUNED, 0.0)["weight"], BASE["weight"])
    assert torch.equal(between(BASE, TUNED, 1.0)["weight"], TUNED["weight"])


def test_integers_are_not_averaged():
    assert int(between(BASE, TUNED, 0.25)["count"]) == 4


def test_nothing_is_changed_in_place():
    between(BASE, TUNED, 0.5)
    assert BASE["weight"].tolist() == [1.0, 2.0]
    assert TUNED["weight"].tolist() == [3.0, -2.0]
