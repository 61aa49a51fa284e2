# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The search for foreign operators in the code of a model file."""

import pytest

from mtpgo_core.task.model_file import find_model, read_model
from mtpgo_core.task.model_operators import OPERATORS, foreign_operators


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("x = torch.add(a, b)", []),
        ("x = torch.add_(a, b)", []),
        ("x = ops.prim.min(a)", []),
        ("x : __torch__.torch.nn.modules.linear.Linear = y", []),
        ("x = my_torch.from_file(a)", []),
        ("x = torch.from_file(a)", ["torch.from_file"]),
        ("x = torch . from_file(a)", ["torch.from_file"]),
        ("x = torch.\\\n  from_file(a)", ["torch.from_file"]),
        ("x = (torch. # a comment\n  from_file)(a)", ["torch.from_file"]),
        ("x = ops.aten.from_file(a)", ["ops.aten.from_file"]),
        ("x = ops.mylib.run(a)", ["ops.mylib.run"]),
        ("x : __torch__.torch.classes.a.B = y", ["__torch__.torch.classes.a.B"]),
        ("x = '\t'", ["the character '\\t'"]),
        ("def f(x: Tensor=torch.rand([1])):", ["torch.rand"]),
    ],
)
def test_what_is_not_on_the_list_is_found(code, found):
    assert list(foreign_operators(code)) == found


def test_the_list_has_nothing_with_an_effect_or_with_data_as_a_number():
    for name in (
        *("from_file", "save", "load", "item", "Int", "Float", "IntImplicit", "FloatImplicit"),
        *("tolist", "rand", "randn", "normal_", "bernoulli_", "manual_seed", "set_", "resize_"),
        *("as_strided", "repeat_interleave", "bincount", "one_hot", "warn", "wait"),
    ):
        assert f"aten::{name}" not in OPERATORS, name
    for name in ("Print", "fork", "PythonOp", "CallMethodOnObject", "Enter"):
        assert f"prim::{name}" not in OPERATORS, name


def test_the_shipped_model_uses_the_list_only():
    for name, content in read_model(find_model("default")).archive.records().items():
        if name.startswith("code/") and name.endswith(".py"):
            assert list(foreign_operators(content.decode())) == []
