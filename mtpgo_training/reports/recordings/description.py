# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What is in the recordings of some files, found out in any process."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from mtpgo_training.data.data_sources import SourceJob
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.summary.recording_defects import Defect, DefectList
from mtpgo_training.data.summary.recording_summary import RecordingSummary, summarise
from mtpgo_training.parallel.kept_results import kept_or_made

if TYPE_CHECKING:
    from mtpgo_training.reports.recordings.data_picture import PictureData


@dataclass
class Description:
    """What is in the recordings of some files.

    Attributes:
        summaries: of each recording with a road user.
        contents: their names, with that of the directory where there are several, and SHA-256.
        picture: what a picture needs of them, None if there is to be none.
    """

    summaries: list[RecordingSummary] = field(default_factory=list)
    contents: list[tuple[str, str]] = field(default_factory=list)
    picture: PictureData | None = None


@dataclass(frozen=True)
class Describing:
    """Describes the recordings of some files.

    Attributes:
        cache: cache of recordings, which it fills.
        resume: folder of the results, if they are kept.
        with_picture: a picture is wanted.
    """

    cache: RecordingCache | None
    resume: Path | None
    with_picture: bool

    def __call__(self, item: SourceJob) -> Description:
        """Return what is in the recordings of some files."""
        if self.resume is None:
            return self._describe(item)
        facts = {
            "what": "description",
            "name": item.name,
            "recordings": item.job.facts(),
            "picture": self.with_picture,
        }
        classes: list[type] = [Description, RecordingSummary, DefectList, Defect]
        if self.with_picture:
            from mtpgo_training.reports.recordings.data_picture import PictureData

            classes.append(PictureData)
        make = functools.partial(self._describe, item)
        return kept_or_made(self.resume, facts, make, classes, Describing._describe)

    def _describe(self, item: SourceJob) -> Description:
        found = Description()
        if self.with_picture:
            # Only here: pictures need matplotlib.
            from mtpgo_training.reports.recordings.data_picture import PictureData

            found.picture = PictureData()
        for name, recording in item.read(self.cache):
            found.summaries.append(summarise(recording))
            found.contents.append((name, recording.sha256))
            if found.picture is not None:
                found.picture.add(recording)
        return found
