# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The numbers of many recordings together, and their text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mtpgo_training.data.manoeuvres import MANOEUVRES
from mtpgo_training.data.summary.recording_defects import KINDS, Defect, DefectList
from mtpgo_training.data.summary.recording_summary import (
    HORIZON_S,
    QUANTILES,
    RecordingSummary,
)
from mtpgo_training.table_format import Row, Table, to_text

MOST_LINES = 5
"""Places of each kind of defect in the text; chosen, the JSON has more."""

MOST_DIGITS = 1e6
"""A number from here on is written with an exponent; chosen, it is a defect."""

MOST_RECORDINGS = 40
"""Recordings in the text's table; chosen, the JSON has all."""


@dataclass(frozen=True)
class DataSummary:
    """What is in many recordings.

    Attributes:
        recordings: what is in each.
        unreadable: what cannot be read, in one sentence each.
        copies: recordings with the content of another; they count in all numbers.
    """

    recordings: Sequence[RecordingSummary]
    unreadable: Sequence[Defect] = ()
    copies: Sequence[Defect] = ()

    @property
    def duration_s(self) -> float:
        """Duration of all recordings (s)."""
        return sum(r.duration_s for r in self.recordings)

    @property
    def classes(self) -> dict[str, int]:
        """Road users by class, the most frequent first."""
        total: Counter[str] = Counter()
        for recording in self.recordings:
            total.update(recording.classes)
        return dict(total.most_common())

    @property
    def manoeuvres(self) -> dict[str, float]:
        """Share of each manoeuvre among the road users observed over the whole horizon."""
        total = sum(r.manoeuvre_count for r in self.recordings)
        return {
            name: sum(r.manoeuvres[name] * r.manoeuvre_count for r in self.recordings)
            / max(1, total)
            for name in MANOEUVRES
        }

    @property
    def defects(self) -> list[DefectList]:
        """The defects of all recordings by kind."""
        lists = [item for recording in self.recordings for item in recording.defects]
        for kind, found in (("unreadable", self.unreadable), ("copy", self.copies)):
            if found:
                lists.append(DefectList(kind, len(found), tuple(found)))
        out = []
        for kind in KINDS:
            of_kind = [item for item in lists if item.kind == kind]
            if of_kind:
                first = tuple(defect for item in of_kind for defect in item.first)
                out.append(DefectList(kind, sum(item.count for item in of_kind), first))
        return out

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON can write it."""
        return {
            "recordings": [recording.to_json() for recording in self.recordings],
            "unreadable": [defect.place for defect in self.unreadable],
            "copies": [str(defect) for defect in self.copies],
            "total": {
                "recordings": len(self.recordings),
                "duration_s": self.duration_s,
                "rows": sum(r.rows for r in self.recordings),
                "tracks": sum(r.tracks for r in self.recordings),
                "classes": self.classes,
                "manoeuvres": self.manoeuvres,
                "manoeuvre_horizon_s": HORIZON_S,
                "defects": {item.kind: item.count for item in self.defects},
            },
        }

    def to_text(self) -> str:
        """Return it as text for a terminal."""
        parts = [self._head(), to_text(self._table())]
        if len(self.recordings) > MOST_RECORDINGS:
            parts[-1] += f"\n... and {len(self.recordings) - MOST_RECORDINGS} more"
        parts += [to_text(self._speeds()), self._manoeuvre_text(), self._defect_text()]
        return "\n\n".join(part for part in parts if part)

    def _head(self) -> str:
        many = len(self.recordings)
        classes = ", ".join(f"{count} {name}" for name, count in self.classes.items())
        sites = sorted({r.location for r in self.recordings if r.location})
        rates = sorted({r.frame_rate for r in self.recordings})
        rate = ", ".join(f"{rate:g}" for rate in rates[:6]) + (" ..." if len(rates) > 6 else "")
        lines = [
            f"{many} recording{'s' * (many != 1)}, {_duration(self.duration_s)}, at {rate} Hz"
            + (f", {len(sites)} site{'s' * (len(sites) != 1)}" if sites else ""),
            f"{sum(r.tracks for r in self.recordings)} road users: {classes}",
        ]
        return "\n".join(lines)

    def _table(self) -> Table:
        heads = ("recording", "duration", "Hz", "road users", "at a time", "most", "moving",
                 "median m/s", "max m/s", "defects")  # fmt: skip
        rows = [
            Row(
                r.name,
                (
                    _duration(r.duration_s),
                    f"{r.frame_rate:g}",
                    str(r.tracks),
                    f"{r.agents_mean:.1f}",
                    str(r.agents_most),
                    f"{100 * r.speed['all']['moving']:.0f} %",
                    _number(r.speed["all"].get("q50")),
                    _number(r.speed["all"].get("max")),
                    str(sum(item.count for item in r.defects)),
                ),
            )
            for r in self.recordings[:MOST_RECORDINGS]
        ]
        return Table(heads, rows)

    def _speeds(self) -> Table:
        """Return the speeds of each class, over the rows of all recordings."""
        rows = []
        for name, count in self.classes.items():
            found = [r for r in self.recordings if name in r.speed]
            weight = sum(r.speed[name]["rows"] for r in found)
            moving = [r for r in found if "max" in r.speed[name]]
            total = sum(_moving_rows(r, name) for r in moving)
            share = total / weight if weight else 0.0
            cells = [str(count), f"{100 * share:.0f} %"]
            cells += [_number(value) for value in _quantiles(moving, name)]
            cells.append(_number(max((r.speed[name]["max"] for r in moving), default=None)))
            rows.append(Row(name, cells))
        return Table(
            ("class", "road users", "moving", "5 % m/s", "median m/s", "95 % m/s", "max m/s"), rows
        )

    def _manoeuvre_text(self) -> str:
        total = sum(r.manoeuvre_count for r in self.recordings)
        if not total:
            return f"No road user is observed for {HORIZON_S:g} s, so none has a manoeuvre."
        shares = ", ".join(
            f"{name.replace('_', ' ')} {100 * share:.1f} %"
            for name, share in self.manoeuvres.items()
        )
        return f"Over the next {HORIZON_S:g} s ({total} instants of road users): {shares}"

    def _defect_text(self) -> str:
        if not self.defects:
            return "No defects found."
        lines = ["Defects:"]
        for item in self.defects:
            lines.append(f"  {item.count} x {item.kind} ({KINDS[item.kind]})")
            lines += [f"    {defect}" for defect in item.first[:MOST_LINES]]
            if item.count > MOST_LINES:
                lines.append(f"    ... and {item.count - MOST_LINES} more")
        return "\n".join(lines)


def _moving_rows(recording: RecordingSummary, name: str) -> float:
    """Return the number of rows of a class in which it moves."""
    return recording.speed[name]["rows"] * recording.speed[name]["moving"]


def _quantiles(recordings: Sequence[RecordingSummary], name: str) -> list[float | None]:
    """Return the ``QUANTILES`` of a class's speeds over the moving rows of recordings (m/s)."""
    if not recordings:
        return [None] * len(QUANTILES)
    if len(recordings) == 1:
        return [recordings[0].speed[name][f"q{round(100 * q):02d}"] for q in QUANTILES]
    speeds = np.concatenate([r.moving_mps[name] for r in recordings])
    shares = [np.full(n := len(r.moving_mps[name]), _moving_rows(r, name) / n) for r in recordings]
    order = np.argsort(speeds, kind="stable")
    weight = np.concatenate(shares)[order]
    level = (np.cumsum(weight) - 0.5 * weight) / weight.sum()
    return [float(value) for value in np.interp(QUANTILES, level, speeds[order])]


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.1f} s"
    return f"{seconds / 60:.1f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def _number(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.1f}" if value < MOST_DIGITS else f"{value:.3g}"
