# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
r"""Formulas as MathML, made when the site is built.

Pages write ``$...$`` and ``$$...$$``, with the equation's number as ``\tag{12}``, which GitHub and
GitLab show as well. Every current browser draws MathML, so no script, font or server is needed.
"""

from __future__ import annotations

import html
import re

from latex2mathml.converter import convert

_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
_BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)
_TAG = re.compile(r"\\tag\{([^}]*)\}")


def with_mathml(page: str) -> str:
    """Return a page's HTML with its formulas as MathML."""
    page = _INLINE.sub(lambda found: convert(html.unescape(found[1]).strip()), page)
    return _BLOCK.sub(lambda found: _block(html.unescape(found[1])), page)


def _block(formula: str) -> str:
    """Return a formula on a line of its own, with its number at the right."""
    tag = _TAG.search(formula)
    # The converter knows align* only, which displays of Markdown do not take within $$.
    lines = _TAG.sub("", formula).strip().replace("{aligned}", "{align*}")
    drawn = convert(lines, display="block")
    number = f'<span class="equation-number">({html.escape(tag[1])})</span>' if tag else ""
    anchor = f' id="eq-{html.escape(tag[1])}"' if tag else ""
    return f'<div class="equation"{anchor}>{drawn}{number}</div>'
