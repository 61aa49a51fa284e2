# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The site is built without a warning, and has what the code has."""

import dataclasses
import html
import re

import pytest
from page_blocks import ROOT

pytest.importorskip("mkdocs")
pytest.importorskip("rclpy")

from mkdocs.commands.build import build
from mkdocs.config import load_config

from docs_site import code_pages, repository_pages
from docs_site.code_excerpts import ExcerptError, excerpt, requests_in
from docs_site.command_parsers import all_parsers
from docs_site.formulas import with_mathml
from docs_site.site_hooks import navigation, on_page_content

THEORY = ROOT / "docs" / "theory.md"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The built site; a warning of MkDocs ends the build."""
    folder = tmp_path_factory.mktemp("site")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT)
        build(load_config(str(ROOT / "mkdocs.yml"), site_dir=str(folder), strict=True))
    return folder


def page(site, name):
    """Return the text of a page without its tags."""
    text = (site / name).read_text(encoding="utf-8")
    return html.unescape(re.sub(r"<[^>]+>", "", text))


def test_every_page_and_model_card_is_in_the_site(site):
    for target in repository_pages.markdown_pages(ROOT).values():
        assert (site / target).with_suffix(".html").is_file(), target
    home = (site / "index.html").read_text(encoding="utf-8")
    linked = set(re.findall(r'href="([\w/]+\.html)" class="md-nav__link"', home))
    assert {"theory.html", "models/default.html", "generated/parameters.html"} <= linked


def test_the_page_of_parameters_has_those_of_the_code(site):
    text = page(site, "generated/parameters.html")
    for node, parameters in code_pages.NODES.items():
        assert f"Parameters of {node}" in text
        for field in dataclasses.fields(parameters):
            assert field.name in text
            assert field.metadata["description"] in text
    for topic in ("objects", "lane_markings", "~/predictions", "~/predicted_objects"):
        assert topic in text
    assert "~/swap_model" in text
    assert "best effort, keep last 5" in text


def test_the_page_of_commands_has_every_option(site):
    text = page(site, "generated/commands.html")
    for name, _, parser in all_parsers():
        assert name in text
        for option in parser._option_string_actions:
            assert option in text, f"{name} {option}"


def test_every_equation_of_the_paper_is_drawn(site):
    text = (site / "theory.html").read_text(encoding="utf-8")
    drawn = {int(number) for number in re.findall(r'id="eq-(\d+)"><math', text)}
    assert drawn == set(range(1, 36))
    assert "arithmatex" not in text
    assert not re.search(r"<m\w+>\\", text), "a command of LaTeX that was not converted"


def test_excerpts_are_in_the_page_and_lead_to_their_line(site):
    text = (site / "theory.html").read_text(encoding="utf-8")
    for path, name in requests_in(THEORY.read_text(encoding="utf-8")):
        found = excerpt(ROOT, path, name)
        anchor = f"__codelineno-0-{found.first_line}"
        assert f'href="source/{path}.html#{anchor}"' in text
        assert f'id="{anchor}"' in (site / "source" / f"{path}.html").read_text(encoding="utf-8")
        assert found.text.splitlines()[-1].strip() in page(site, "theory.html")


def test_nothing_is_loaded_from_elsewhere(site):
    loaded = re.compile(
        r"<(?:script|link|img|iframe|source)\b[^>]*(?:src|href)=\"((?:https?:)?//[^\"]+)"
    )
    for file in site.rglob("*.html"):
        assert not loaded.findall(file.read_text(encoding="utf-8")), file.name
    style = (site / "assets" / "site.css").read_text(encoding="utf-8")
    assert "url(" not in style
    assert "@import" not in style


def test_a_topic_without_a_row_in_the_documentation_is_named():
    with pytest.raises(LookupError, match="no row for ~/thoughts"):
        code_pages.described("| `~/predictions` | x | y |\n", "~/thoughts")
    row = "| `~/a` | type | QoS | see [below](#odd) and [here](messages.md#x) |\n"
    about = "see [below](../node.md#odd) and [here](../messages.md#x)"
    assert code_pages.described(row, "~/a") == about


def test_an_excerpt_has_no_docstring_and_keeps_its_line(tmp_path):
    (tmp_path / "a.py").write_text(
        'class A:\n    """Doc."""\n\n    @wraps\n    def f(self):\n        """Doc.\n\n'
        '        More.\n        """\n        return "x"  # why\n'
    )
    found = excerpt(tmp_path, "a.py", "A.f")
    assert (found.first_line, found.text) == (5, 'def f(self):\n    return "x"  # why')
    with pytest.raises(ExcerptError, match=r"a\.py has no A\.g, expected one of f"):
        excerpt(tmp_path, "a.py", "A.g")
    with pytest.raises(ExcerptError, match=r"b\.py is not a file"):
        excerpt(tmp_path, "b.py", "A")


def test_pages_that_are_not_there_are_left_out_of_the_navigation():
    nav = [{"Start": ["a.md", "gone.md"]}, {"Cards": "models/"}, {"Other": ["gone.md"]}]
    there = {"a.md", "b.md", "models/default.md"}
    assert navigation(nav, there, ["models/default.md"]) == [
        {"Start": ["a.md"]},
        {"Cards": [{"default": "models/default.md"}]},
        {"More": ["b.md"]},
    ]


def test_links_lead_to_pages_of_the_site():
    text = (
        "[a](../README.md#results) [b](../models/ekf.py) [c](node.md) [d](https://x)"
        " `[e](../setup.py)`"
    )
    assert repository_pages.rewritten(ROOT, "docs/theory.md", "theory.md", text) == (
        "[a](index.md#results) [b](source/models/ekf.py.md) [c](node.md) [d](https://x)"
        " `[e](../setup.py)`"
    )
    card = "[training](../../docs/training.md#x) ![p](../../docs/images/prediction.png)"
    found = repository_pages.rewritten(
        ROOT, "resource/weights/default.md", "models/default.md", card
    )
    assert found == "[training](../training.md#x) ![p](../images/prediction.png)"


def test_a_link_called_by_its_file_gets_the_title_of_the_page():
    text = "[view.md](view.md) [../README.md](../README.md#results) [node.md](view.md)"
    assert repository_pages.rewritten(ROOT, "docs/theory.md", "theory.md", text) == (
        "[Seeing predictions over time](view.md) [mtpgo_ros](index.md#results) [node.md](view.md)"
    )


def test_short_code_is_kept_in_one_line():
    long, block = f"<code>{'x' * 40}</code>", "<pre><code><span>a</span></code></pre>"
    drawn = on_page_content(f"<p><code>--lane-file</code>{long}</p>{block}", None, None, None)
    assert drawn == f'<p><code class="short">--lane-file</code>{long}</p>{block}'


def test_formulas_have_their_number():
    page = '<div class="arithmatex">\\[\na &lt; b \\tag{7}\n\\]</div>'
    drawn = with_mathml(page)
    assert '<div class="equation" id="eq-7"><math' in drawn
    assert drawn.endswith('<span class="equation-number">(7)</span></div>')
    assert "&#x0003C;" in drawn
