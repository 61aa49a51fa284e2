# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What MkDocs calls while it builds the site (``hooks`` in mkdocs.yml)."""

from __future__ import annotations

import os
import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

from docs_site import repository_pages
from docs_site.code_excerpts import REQUEST, excerpt, requests_in
from docs_site.formulas import with_mathml

ROOT = Path(__file__).resolve().parents[1]
STYLE = Path(__file__).with_name("site.css")
LICENCE = "project/licence.md"
PARAMETERS, COMMANDS = "generated/parameters.md", "generated/commands.md"

_SAME_FILE = re.compile(r"(?<=\n\n)\[[^\]\n]+\]\([^)\n]+\):\n\n(?=<!-- code: )")
"""A link to a file on a line of its own before its excerpt, whose title is the same link."""

_SHORT_CODE = re.compile(r"<code>([^<\n]{1,32})</code>")
"""Code within a sentence that has space in a line, on a phone as well."""

_paths: dict[str, str] = {}
"""Page of the site -> its path in the repository."""


def on_config(config: Any) -> Any:
    """Leave out entries of the navigation whose page is not there, and list the other pages."""
    _paths.clear()
    _paths.update(
        {target: path for path, target in repository_pages.markdown_pages(ROOT).items()}
        | {"index.md": "README.md"}
    )
    there = {*_paths, PARAMETERS, COMMANDS, LICENCE}
    cards = sorted(page for page in there if page.startswith("models/"))
    config.nav = navigation(config.nav, there, cards)
    return config


def navigation(nav: list[Any], there: set[str], cards: list[str]) -> list[Any]:
    """Return the navigation of the pages that are there.

    Args:
        nav: of mkdocs.yml; ``models/`` stands for the model cards.
        there: pages of the site.
        cards: those that are model cards.
    """
    listed: set[str] = set()

    def chosen(entry: Any) -> Any:
        if isinstance(entry, str):
            listed.add(entry)
            return entry if entry in there else None
        ((title, inside),) = entry.items()
        if inside == "models/":
            listed.update(cards)
            return {title: [{_stem(card): card} for card in cards]} if cards else None
        if isinstance(inside, str):
            listed.add(inside)
            return entry if inside in there else None
        kept = [item for item in map(chosen, inside) if item is not None]
        return {title: kept} if kept else None

    kept = [item for item in map(chosen, nav) if item is not None]
    rest = sorted(there - listed)
    return [*kept, {"More": rest}] if rest else kept


def _stem(page: str) -> str:
    """Return the name of a page's file without its suffix."""
    return posixpath.basename(page).removesuffix(".md")


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are no files of docs/."""
    index = files.get_file_from_path("index.md")
    if index is not None:
        files.remove(index)

    def add(target: str, text: str) -> None:
        files.append(File.generated(config, target, content=text))

    for target, path in _paths.items():
        if path != f"docs/{target}":
            add(target, (ROOT / path).read_text(encoding="utf-8"))
    licence = (ROOT / "LICENSE").read_text(encoding="utf-8")
    add(LICENCE, f"# Licence\n\n```text\n{licence}\n```\n")
    shown = repository_pages.linked_files(ROOT)
    for path in _paths.values():
        text = (ROOT / path).read_text(encoding="utf-8")
        shown |= {name for name, _ in requests_in(text)}
    for path in sorted(shown):
        add(repository_pages.source_page(path), repository_pages.source_markdown(ROOT, path))
    add("assets/site.css", STYLE.read_text(encoding="utf-8"))
    add(PARAMETERS, _parameter_page())
    add(COMMANDS, _command_page())
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Put the code excerpts in, and make links lead to pages of the site."""
    here = page.file.src_uri
    path = _paths.get(here)
    if path is None:
        return markdown
    text = repository_pages.rewritten(ROOT, path, here, markdown)
    text = _SAME_FILE.sub("", text)
    return REQUEST.sub(lambda found: _shown(here, found["path"], found["name"]), text)


def on_page_content(html: str, page: Any, config: Any, files: Files) -> str:
    """Draw the formulas, and keep short code in one line."""
    return _SHORT_CODE.sub(r'<code class="short">\1</code>', with_mathml(html))


def _shown(here: str, path: str, name: str) -> str:
    """Return an excerpt as a code block with a link to its place in the file."""
    found = excerpt(ROOT, path, name)
    page = repository_pages.source_page(path).removesuffix(".md") + ".html"
    link = os.path.relpath(page, posixpath.dirname(here) or ".")
    line = found.first_line
    title = f'<a href="{link}#__codelineno-0-{line}"><code>{path}</code>, line {line}</a>'
    return f'<p class="excerpt">{title}</p>\n\n```python\n{found.text}\n```'


def _parameter_page() -> str:
    from docs_site.code_pages import node_page_text, parameter_page
    from docs_site.node_interfaces import node_interfaces

    return parameter_page(node_interfaces(), node_page_text(ROOT))


def _command_page() -> str:
    from docs_site.code_pages import command_page
    from docs_site.command_parsers import all_parsers

    return command_page(all_parsers())
