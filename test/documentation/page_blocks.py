# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The code blocks of all pages, and the simple commands in those of shell."""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("resource/**/*.md")])

_FENCE = re.compile(r"^( *)(`{3,})([^\n]*)\n(.*?)^\1\2 *$", re.DOTALL | re.MULTILINE)
_REASON = re.compile(r"<!-- not run: (.+) -->$")

PLACEHOLDERS = {
    "LAYOUT": "ind",
    "KIND": "latency",
    "BAG=TOPIC": "bag=/topic",
}
"""What stands in a page for a value that has to be one of several."""


@dataclass(frozen=True)
class Block:
    """A fenced code block.

    Attributes:
        page: the file.
        line: of its fence, counted from 1.
        language: as given; ``sh`` and ``console`` where none is.
        text: what is in it.
        reason: why it cannot be run, empty if it can.
    """

    page: Path
    line: int
    language: str
    text: str
    reason: str

    @property
    def place(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def blocks_of(text: str, page: Path = ROOT / "README.md") -> Iterator[Block]:
    """Yield the blocks of a page."""
    for match in _FENCE.finditer(text):
        before = text[: match.start()].rstrip().rpartition("\n")[2]
        reason = _REASON.search(before)
        language = match[3].split()[0] if match[3].strip() else ""
        if not language:
            language = "console" if match[4].lstrip().startswith("$ ") else "sh"
        body = "".join(line.removeprefix(match[1]) for line in match[4].splitlines(True))
        line = text.count("\n", 0, match.start()) + 1
        yield Block(page, line, language, body, reason[1] if reason else "")


def all_blocks() -> list[Block]:
    return [block for page in PAGES for block in blocks_of(page.read_text(encoding="utf-8"), page)]


def script_of(block: Block) -> str:
    """Return the shell script of a block; of a session the lines after ``$``."""
    text = block.text
    if block.language == "console":
        lines: list[str] = []
        for line in text.splitlines():
            if line.startswith("$ ") or (lines and lines[-1].endswith("\\")):
                lines.append(line.removeprefix("$ "))
        text = "\n".join(lines) + "\n"
    return re.sub(r"<[a-z][\w ]*>", "PLACEHOLDER", text)


def commands_in(script: str) -> Iterator[list[str]]:
    """Yield the words of every simple command of a script without loops and functions.

    Comments, redirections and assignments before a command are left out.
    """
    for line in script.replace("\\\n", " ").splitlines():
        lexer = shlex.shlex(line, posix=True, punctuation_chars="&|;<>")
        lexer.whitespace_split = True
        lexer.commenters = ""
        words: list[str] = []
        skip = False
        for word in _without_comment(lexer):
            if skip:
                skip = False
            elif set(word) <= set("&|;"):
                if words:
                    yield words
                words = []
            elif set(word) <= set("<>&"):
                skip = True
            elif words or not re.fullmatch(r"[A-Z_][A-Z0-9_]*=.*", word):
                words.append(word)
        if words:
            yield words


def _without_comment(words: Iterator[str]) -> Iterator[str]:
    for word in words:
        if word.startswith("#"):
            return
        yield word
