# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files of the repository as pages of the site, and links that lead to them.

The pages of docs/ link to files of the repository as they are there, so that the links work in a
checkout as well. In the site README and the model cards are pages, and every other file that a
page links to is shown on a page of its own.
"""

from __future__ import annotations

import os
import posixpath
import re
from pathlib import Path, PurePosixPath

DOCS = "docs"
"""Folder of the pages, in the repository."""

PAGES = {
    "README.md": "index.md",
    "SECURITY.md": "project/security.md",
    "CONTRIBUTING.md": "project/contributing.md",
    "CHANGELOG.md": "project/changelog.md",
    "QUALITY_DECLARATION.md": "project/quality_declaration.md",
}
"""Pages of the site that are Markdown files outside of docs/."""

INDEX = "docs/index.md"
"""The list of pages for readers of the repository; in the site the navigation is that list."""

CARDS = "resource/weights"
SOURCE = "source"
"""Folder of the site with the files of the repository that pages link to."""

LANGUAGES = {
    "": "text",
    ".cff": "yaml",
    ".cfg": "ini",
    ".hpp": "cpp",
    ".md": "markdown",
    ".osm": "xml",
    ".py": "python",
    ".rviz": "yaml",
    ".service": "ini",
    ".txt": "text",
    ".yml": "yaml",
}
"""Language of a file by its suffix, where that is not the suffix itself."""

_LINK = re.compile(r"(\]\()([^)\s]+)(\))")
_FILE_NAME = re.compile(r"(\[)([\w./-]+\.md)\]\(([^)\s#]+)[^)\s]*\)")
"""A link to a page, whose text is the page's file."""
_TITLE = re.compile(r"^# (.+)$", re.MULTILINE)
_CODE = re.compile(r"(^ *(?P<fence>`{3,}|~{3,}).*?^ *(?P=fence) *$|`[^`\n]+`)", re.DOTALL | re.M)


def markdown_pages(root: Path) -> dict[str, str]:
    """Return the Markdown files that are pages: path in the repository -> path in the site."""
    pages = {name: target for name, target in PAGES.items() if (root / name).is_file()}
    for card in sorted((root / CARDS).glob("*.md")):
        pages[f"{CARDS}/{card.name}"] = f"models/{card.name}"
    for page in sorted((root / DOCS).rglob("*.md")):
        name = page.relative_to(root).as_posix()
        if name != INDEX:
            pages[name] = page.relative_to(root / DOCS).as_posix()
    pages[INDEX] = PAGES["README.md"]
    return pages


def source_page(path: str) -> str:
    """Return the page of the site that shows a file of the repository."""
    return f"{SOURCE}/{path}.md"


def source_markdown(root: Path, path: str) -> str:
    """Return the page that shows a file of the repository."""
    suffix = PurePosixPath(path).suffix
    language = LANGUAGES.get(suffix, suffix.removeprefix("."))
    text = (root / path).read_text(encoding="utf-8").rstrip("\n")
    fence = "`" * max(3, 1 + max(map(len, re.findall(r"`+", text)), default=0))
    return (
        f"---\nsearch:\n  exclude: true\nhide:\n  - toc\n---\n\n# `{path}`\n\n"
        f'{fence}{language} linenums="1"\n{text}\n{fence}\n'
    )


def links_in(text: str) -> list[str]:
    """Return the targets of a page's links outside of code."""
    return [link for part in _prose(text) for _, link, _ in _LINK.findall(part)]


def repository_path(root: Path, page: str, link: str) -> str | None:
    """Return the path in the repository that a link leads to, None for links that leave it.

    Args:
        root: of the repository.
        page: the page with the link, from the root.
        link: its target without an anchor.
    """
    if not link or re.match(r"[a-z][a-z+.-]*:|/", link):
        return None
    path = posixpath.normpath(posixpath.join(posixpath.dirname(page), link))
    return path if not path.startswith("..") and (root / path).exists() else None


def rewritten(root: Path, page: str, here: str, text: str) -> str:
    """Return a page with links that lead to the same things in the site.

    Args:
        root: of the repository.
        page: path of the page in the repository.
        here: its path in the site.
        text: the page.
    """
    pages = markdown_pages(root)

    def replaced(match: re.Match[str]) -> str:
        link, hash_mark, anchor = match[2].partition("#")
        path = repository_path(root, page, link)
        if path is None:
            return match[0]
        if path in pages:
            target = pages[path]
        elif path.startswith(f"{DOCS}/"):
            target = path.removeprefix(f"{DOCS}/")
        elif (root / path).is_file():
            target = source_page(path)
        else:
            return match[0]
        relative = os.path.relpath(target, posixpath.dirname(here) or ".")
        return f"{match[1]}{Path(relative).as_posix()}{hash_mark}{anchor}{match[3]}"

    def titled(match: re.Match[str]) -> str:
        """Return the link with the title of the page, which readers of the site know it by."""
        path = repository_path(root, page, match[3])
        if (
            path is None
            or path not in pages
            or posixpath.basename(path) != posixpath.basename(match[2])
        ):
            return match[0]
        title = _TITLE.search((root / path).read_text(encoding="utf-8"))
        return match[0].replace(match[2], title[1], 1) if title else match[0]

    return "".join(
        part if number % 2 else _LINK.sub(replaced, _FILE_NAME.sub(titled, part))
        for number, part in enumerate(_split(text))
    )


def linked_files(root: Path) -> set[str]:
    """Return the files of the repository that pages link to and that are no pages themselves."""
    pages = markdown_pages(root)
    found = set()
    for page in pages:
        for link in links_in((root / page).read_text(encoding="utf-8")):
            path = repository_path(root, page, link.partition("#")[0])
            if not path or path in pages or path.startswith(f"{DOCS}/"):
                continue
            if (root / path).is_file():
                found.add(path)
    return found


def _prose(text: str) -> list[str]:
    return _split(text)[::2]


def _split(text: str) -> list[str]:
    """Return a page's parts, in turn prose and code, beginning with prose."""
    parts, end = [], 0
    for match in _CODE.finditer(text):
        parts += [text[end : match.start()], match[0]]
        end = match.end()
    return [*parts, text[end:]]
