# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What of a damaged bag is read and what is lost, as a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


def counted(messages: int) -> str:
    """Return a number of messages in words."""
    return f"{messages} message{'' if messages == 1 else 's'}"


@dataclass(frozen=True)
class BagLoss:
    """Loss in one file of a bag.

    Attributes:
        file: the file.
        reason: what is wrong with it, after its name: ``is cut off at byte 1234``.
        read: messages that are read.
        read_s: from the first to the last of them (s).
        messages: messages that are lost; None where nothing tells.
        seconds: duration that is lost (s); None where nothing tells.
        exact: ``messages`` is counted, not estimated from the size of what is missing.
    """

    file: Path
    reason: str
    read: int
    read_s: float
    messages: int | None = None
    seconds: float | None = None
    exact: bool = False

    def sentence(self) -> str:
        """Return the loss as a sentence."""
        read = f"{counted(self.read)} ({self.read_s:.1f} s) read"
        if not self.read:
            read = "nothing of it is read"
        return f"{self.file} {self.reason}: {read}, {self._lost()}"

    def _lost(self) -> str:
        if self.messages is None and self.seconds is None:
            return "how much is lost is not known"
        if self.messages is None:
            return f"up to {self.seconds:.1f} s lost, of how many messages is not known"
        number = f"{'' if self.exact else 'about '}{counted(self.messages)}"
        if self.messages == 0:
            return "no message of what was written is lost"
        if self.seconds is None:
            return f"{number} lost"
        return f"{number} ({self.seconds:.1f} s) lost"
