# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The figures of the paper's tables (Westny et al., "MTP-GO", IEEE T-IV 2023), as published.

Errors in m, likelihoods in nats. Of the ablation the half widths of the 95 % intervals over ten
seeds, too.
"""

from __future__ import annotations

from dataclasses import dataclass

VALUES = ("ade", "fde", "mr", "apde", "anll", "fnll")
"""Columns of all tables but that of the road users."""

CLASSES = ("pedestrian", "bicycle", "car")
"""Road users of table "InD performance per road user", which has ADE and FDE of each."""

CLASS_VALUES = tuple(f"{kind}.{value}" for kind in CLASSES for value in ("ade", "fde"))
"""Columns of that table."""

_LAYERS = {
    "highd": """
graphconv  0.29 0.97 0.06 0.28 -1.67 1.61
gcn        0.29 0.99 0.07 0.28 -1.75 1.60
gat-1      0.32 1.04 0.07 0.31 -1.56 1.68
gat-3      0.30 0.96 0.07 0.28 -1.57 1.61
gat-5      0.28 0.91 0.06 0.27 -1.76 1.42
gat+-1     0.29 0.94 0.06 0.27 -1.75 1.43
gat+-3     0.28 0.91 0.06 0.27 -1.78 1.44
gat+-5     0.27 0.90 0.06 0.26 -1.86 1.40""",
    "round": """
graphconv  1.03 3.28 0.38 0.62 -0.14 3.96
gcn        1.86 5.68 0.62 1.13 1.15 4.95
gat-1      1.36 4.12 0.44 0.84 0.57 4.27
gat-3      1.37 4.08 0.47 0.84 0.67 4.33
gat-5      1.24 3.77 0.43 0.78 0.56 4.28
gat+-1     0.97 3.05 0.36 0.60 -0.17 3.86
gat+-3     0.98 3.06 0.35 0.61 -0.06 3.88
gat+-5     0.97 3.02 0.35 0.62 -0.03 3.90""",
}

_STATIC = {
    "ind": """
ca         0.72 2.20 1.87 5.95 2.35 7.61
cv         0.58 1.42 2.06 5.40 2.90 7.42
mtp-go1    0.38 1.03 0.90 3.38 1.07 3.38
mtp-go1-s  0.39 1.05 0.90 2.65 1.08 3.32
mtp-go2    0.42 1.13 1.01 3.00 1.27 3.86
mtp-go2-s  0.40 1.08 1.00 2.98 1.20 3.69""",
}

_COMPARISON = {
    "highd": """
ca             0.78 2.63 0.55 0.73 - -
cv             1.49 4.01 0.79 1.89 - -
seq2seq        0.57 1.68 0.29 0.54 - -
s-lstm         0.41 1.49 0.22 0.39 -0.61 3.20
cs-lstm        0.39 1.38 0.19 0.37 -0.66 3.33
gnn-rnn        0.40 1.40 0.17 0.38 - -
mmtransformer  0.39 1.13 0.15 0.39 - -
trajectron++   0.44 1.62 0.23 0.32 -1.57 1.63
mtp-go1        0.30 1.07 0.13 0.30 -1.59 2.02
mtp-go2        0.35 1.16 0.15 0.34 -1.34 2.18""",
    "round": """
ca             4.83 16.2 0.95 3.90 - -
cv             6.49 17.1 0.94 4.34 - -
seq2seq        1.46 3.66 0.59 0.82 - -
s-lstm         1.20 3.47 0.56 0.74 1.75 5.12
cs-lstm        1.19 3.57 0.60 0.69 2.09 5.54
gnn-rnn        1.13 3.11 0.51 0.69 - -
mmtransformer  1.29 3.50 0.59 0.77 - -
trajectron++   1.09 3.53 0.54 0.59 -4.25 1.50
mtp-go1        0.96 2.95 0.46 0.59 0.22 3.38
mtp-go2        0.92 2.97 0.48 0.57 -0.22 3.85""",
}

_ABLATION = {
    "highd": """
1  0.28 0.00 0.92 0.01 0.06 0.00 0.27 0.00 -1.74 0.05 1.48 0.05
2  0.28 0.00 0.92 0.01 0.06 0.00 0.27 0.00 -1.75 0.06 1.47 0.05
3  0.28 0.00 0.94 0.01 0.06 0.00 0.27 0.00 -1.81 0.03 1.44 0.02
4  0.29 0.02 0.97 0.03 0.07 0.01 0.28 0.02 -1.76 0.86 1.58 0.28
5  0.44 0.02 1.15 0.08 0.18 0.03 0.42 0.02 0.63 0.12 2.22 0.05
6  0.30 0.00 1.03 0.01 0.07 0.00 0.29 0.00 -1.75 0.05 1.61 0.02
7  0.31 0.02 1.07 0.03 0.08 0.00 0.30 0.01 -1.34 1.12 1.83 0.36""",
    "round": """
1  0.99 0.02 3.10 0.05 0.37 0.02 0.61 0.02 -0.18 0.02 3.78 0.02
2  0.98 0.01 3.05 0.04 0.37 0.02 0.61 0.02 -0.21 0.02 3.79 0.02
3  1.07 0.02 3.40 0.06 0.40 0.02 0.63 0.01 -0.10 0.06 3.92 0.03
4  1.23 0.07 3.83 0.18 0.57 0.03 0.72 0.03 0.20 0.08 4.08 0.07
5  1.06 0.02 3.05 0.05 0.45 0.03 0.65 0.02 1.60 0.02 3.48 0.01
6  1.13 0.01 3.64 0.04 0.40 0.02 0.61 0.02 -0.17 0.02 3.95 0.02
7  1.25 0.01 3.98 0.04 0.51 0.02 0.70 0.01 0.06 0.05 4.03 0.03""",
}

BY_KERNELS = ("trajectron++",)
"""Rows whose likelihoods are kernel density estimates from samples, in italics in the paper."""

KERNEL_REMARK = (
    "The paper gives the likelihoods of Trajectron++ in italics: they are kernel density "
    "estimates from samples. By the same estimate it finds -7.16 (average) and -3.35 (final) for "
    "MTP-GO2 on highD, instead of the analytic -1.34 and 2.18: the two kinds cannot be compared."
)
"""Of the comparison; the paper's section "Highway"."""


@dataclass(frozen=True)
class PaperValue:
    """A figure of the paper.

    Attributes:
        value: in m, nats, or a share.
        half_width: of its 95 % interval over ten seeds, None where the paper has none.
    """

    value: float
    half_width: float | None = None

    def __str__(self) -> str:
        return f"{self.value:.2f}" + (
            "" if self.half_width is None else f" ± {self.half_width:.2f}"
        )


PaperTable = dict[str, dict[str, PaperValue]]
"""By row and column."""


def _plain(text: str, columns: tuple[str, ...]) -> PaperTable:
    table: PaperTable = {}
    for line in text.strip().splitlines():
        row, *values = line.split()
        pairs = zip(columns, values, strict=True)
        table[row] = {name: PaperValue(float(value)) for name, value in pairs if value != "-"}
    return table


def _with_widths(text: str) -> PaperTable:
    table: PaperTable = {}
    for line in text.strip().splitlines():
        row, *given = line.split()
        numbers = list(map(float, given))
        pairs = zip(numbers[::2], numbers[1::2], strict=True)
        table[row] = {name: PaperValue(*pair) for name, pair in zip(VALUES, pairs, strict=True)}
    return table


PAPER: dict[str, dict[str, PaperTable]] = {
    "layers": {name: _plain(text, VALUES) for name, text in _LAYERS.items()},
    "static": {name: _plain(text, CLASS_VALUES) for name, text in _STATIC.items()},
    "comparison": {name: _plain(text, VALUES) for name, text in _COMPARISON.items()},
    "ablation": {name: _with_widths(text) for name, text in _ABLATION.items()},
}
"""By study and data set."""

PAPER_CAPTIONS = {
    "layers": 'table "Performance of MTP-GO2 using different types of GNN layers"',
    "static": 'table "InD performance per road user"',
    "comparison": 'tables "HighD performance" and "RounD performance"',
    "ablation": 'table "Ablation Study"',
}
"""By study, where its figures stand in the paper."""
