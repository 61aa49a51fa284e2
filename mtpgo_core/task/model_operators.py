# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The operators that a model file may use, and the check of its code before torch reads it.

TorchScript is a program. Most of its operators compute tensors from tensors, but some open files,
print, or reach classes written in C++. Only operators on the list below may occur, in whatever
place of the code: in ``forward``, in functions that it calls, in default arguments and in
``__setstate__``, which torch runs while it loads a file. The list holds what the exported networks
and the usual layers need; none of it has an effect outside the tensors and lists of the model.

No operator on it turns data into a whole number: ``item``, ``Int``, ``Float`` and the like are
missing, so that the number of repetitions of a loop depends on the shapes of the input only.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

_TENSORS = """
abs acos add addbmm addcdiv addcmul addmm addmv all amax amin aminmax any arange argmax argmin
argsort asin atan atan2 avg_pool1d avg_pool2d baddbmm batch_norm bitwise_and bitwise_not bitwise_or
bmm broadcast_to bucketize cat cdist ceil celu chunk clamp clamp_max clamp_min clone column_stack
concat constant_pad_nd contiguous conv1d conv2d copy copysign cos cosh count_nonzero cross cumprod
cumsum deg2rad det detach diag diag_embed diagonal diff div dot dropout dstack einsum elu embedding
empty empty_like eq erf exp expand expand_as expm1 eye fill flatten flip floor floor_divide fmod
full full_like gather ge gelu gt hardtanh hstack hypot index index_add index_copy index_fill
index_put index_select inner inverse isclose isfinite isinf isnan kron layer_norm le leaky_relu
lerp linalg_cholesky linalg_cross linalg_det linalg_inv linalg_norm linalg_solve
linalg_solve_triangular linalg_vector_norm linear linspace log log1p log2 log_softmax logaddexp
logical_and logical_not logical_or logical_xor logsumexp lstm_cell lt masked_fill masked_select
matmul max max_pool1d max_pool2d maximum mean median meshgrid min minimum mm movedim mul mv
nan_to_num narrow ne neg new_empty new_full new_ones new_zeros norm normalize numpy_T ones
ones_like outer permute pow prelu prod rad2deg reciprocal relu relu6 remainder repeat
reshape roll rsqrt rsub scatter scatter_add searchsorted select selu sigmoid sign
silu sin sinh slice softmax softplus sort split split_with_sizes sqrt square squeeze stack std sub
sum swapaxes t tan tanh tensor tensordot threshold tile to topk transpose tril triu true_divide
trunc type_as unbind unflatten unfold unsqueeze var view view_as vstack where zero zeros zeros_like
block_diag rnn_tanh_cell rnn_relu_cell gru_cell
"""
"""Operators on tensors. Those that have a form with ``_`` at the end, which writes into the tensor
itself, are allowed in this form as well."""

_PLAIN = """
Bool append as_tensor clear copy dim extend format get get_device
is_floating_point is_complex insert items keys len list numel pop reverse size storage_offset
stride values index percentFormat str
__and__ __contains__ __derive_index __getitem__ __is__ __isnot__ __not__ __or__ __range_length
__xor__ __iand__ __ior__ _set_item floordiv ndimension element_size
"""
"""Operators on numbers, texts and lists, and those that ask for a shape."""

_STRUCTURE = """
CallFunction CallMethod Constant CreateObject DictConstruct GetAttr If ListConstruct ListUnpack
Loop NumToTensor RaiseException SetAttr TupleConstruct TupleIndex TupleSlice TupleUnpack
Uninitialized Return Param device dtype is_cpu is_cuda isinstance max min abs layout data
requires_grad unchecked_cast unchecked_unwrap_optional rangelist type
"""
"""What TorchScript itself consists of (namespace prim)."""

OPERATORS = frozenset(
    [f"aten::{name}{end}" for name in _TENSORS.split() for end in ("", "_")]
    + [f"aten::{name}" for name in _PLAIN.split()]
    + [f"prim::{name}" for name in _STRUCTURE.split()]
)
"""Names of all allowed operators, as torch has them in its graphs."""

_GAP = r"(?:\s|\\\n|#[^\n]*\n)*"
_DOTTED = re.compile(rf"(?<![\w.])(?:__torch__|torch|ops)(?:{_GAP}\.{_GAP}\w+)+")
_ODD = re.compile(r"[^\x20-\x7e\n]")


def foreign_operators(code: str) -> Iterator[str]:
    """Yield what the code of a model file uses that is not on the list.

    The whole text is searched, texts in quotes included: what another reader would take for code
    cannot hide.

    Args:
        code: the text of a record below ``code/``.
    """
    odd = _ODD.search(code)
    if odd is not None:
        yield f"the character {odd.group()!r}"
    for match in _DOTTED.finditer(code):
        name = re.sub(_GAP, "", match.group())
        first, _, rest = name.partition(".")
        if first == "__torch__":  # a class of the file, or one of torch written in C++
            if rest.startswith("torch.classes"):
                yield name
        elif first == "torch":
            if f"aten::{rest}" not in OPERATORS:
                yield name
        elif rest.replace(".", "::") not in OPERATORS:
            yield name
