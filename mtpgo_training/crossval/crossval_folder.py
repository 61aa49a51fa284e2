# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The folder of a cross-validation.

``config.yaml`` and ``crossval.json`` (sites, folds, recordings with their hashes, budget) are
written at the start. ``folds/FOLD/`` has the plan of the fold, its run folder, ``training.json``
once it is trained, the exported model, what it printed, and at last ``scores.json``: a fold with
that file is done. ``result.json`` and ``result.md`` are written again after each fold.
"""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import new_folder, read_json, write_text
from mtpgo_training.calibration.calibration_report import calibration_table, leave_one_site_out
from mtpgo_training.calibration.calibration_samples import (
    SAMPLES_FILE,
    CalibrationSamples,
    merge_samples,
)
from mtpgo_training.crossval.crossval_tables import NOTE, scores_table, trainings_table
from mtpgo_training.crossval.planned_training import (
    PlannedFiles,
    require_folder_of,
    require_same_facts,
)
from mtpgo_training.crossval.site_folds import Fold
from mtpgo_training.crossval.site_scores import pooled_scores
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.evaluation.training_overlap import is_known
from mtpgo_training.table_format import Table, to_markdown
from mtpgo_training.training.run_folder import first_difference, load_checkpoint, versions
from mtpgo_training.training.training_config import TrainingConfig, dump_config, load_config
from mtpgo_training.training.trial.schedule_plan import Budget

Json = dict[str, Any]

CALIBRATION_HEADING = "Each site without and with a calibration fitted to the other sites:"
"""Of the table of :meth:`CrossvalFolder.calibration`."""


class FoldFolder(PlannedFiles):
    """The files of one fold; its scores are those by site.

    Attributes:
        samples: the left-out sites' samples for a calibration.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.samples = path / SAMPLES_FILE


class CrossvalFolder:
    """The files of a cross-validation.

    Args:
        path: the folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._config = path / "config.yaml"
        self._facts = path / "crossval.json"
        self.result = path / "result.json"
        self.markdown = path / "result.md"

    @property
    def holds_one(self) -> bool:
        """Whether a cross-validation was started here."""
        return self._facts.is_file()

    def fold(self, name: str) -> FoldFolder:
        """Return the files of a fold."""
        return FoldFolder(self.path / "folds" / re.sub(r"[^\w.-]+", "_", name))

    def runs(self, folds: Sequence[Fold], recordings: Sequence[NamedRecording]) -> dict[str, Path]:
        """Return the run folders of trainings that left out the same recordings, by fold.

        That is the fold of the same name or, where there is none, the first one that left out all
        of its recordings, and others.

        Args:
            folds: of another cross-validation, whose trainings shall begin with these weights.
            recordings: all of that other one.

        Raises:
            ConfigurationError: there is no such fold here, it is not trained, or it or a training
                that it began with has seen a recording that is to be left out, under whatever
                name.
        """
        facts = self._stored_facts() if self.holds_one else {"folds": {}, "sites": {}}
        left_out_by = {
            name: {one for site in sites for one in facts["sites"][site]}
            for name, sites in facts["folds"].items()
        }
        found = {}
        for fold in folds:
            name = fold.name
            if name not in left_out_by:
                wider = (other for other, left in left_out_by.items() if fold.recordings <= left)
                name = next(wider, name)
            files = self.fold(name)
            if name not in left_out_by or not files.training.is_file():
                raise ConfigurationError(
                    f"--init-from is {self.path}, which has no trained fold {name!r}, "
                    "expected a cross-validation with it or with one that leaves out all of it; "
                    f"it has {', '.join(left_out_by) or 'none'}"
                )
            left_out = left_out_by[name]
            known = (set(fold.recordings) - left_out) & set(facts["recordings"])
            training = {"recordings": load_checkpoint(files.run)["splits"]}
            known |= {
                item.name
                for item in recordings
                if item.name in fold.recordings
                and is_known(training, item.recording.sha256, item.name)
            }
            if known:
                raise ConfigurationError(
                    f"--init-from is {self.path}, whose fold {name!r} was trained with "
                    f"{min(known)}, expected one that leaves out what is left out now"
                )
            found[fold.name] = files.run
        return found

    def require_usable(self) -> None:
        """Check that the folder is new or holds a cross-validation.

        Raises:
            ConfigurationError: there is something else in it.
        """
        require_folder_of(self._facts, "cross-validation")

    def start(
        self,
        config: TrainingConfig,
        folds: Sequence[Fold],
        recordings: Sequence[NamedRecording],
        budget: Budget,
        stride_s: float,
        trackers: Sequence[str],
        init_from: Path | None = None,
    ) -> None:
        """Write what determines the results, or check that it is the same as before.

        The section ``trainer`` and the number of threads may differ.

        Args:
            config: the configuration.
            folds: all folds.
            recordings: all recordings.
            budget: of each fold.
            stride_s: time between two scored instants (s).
            trackers: whose observations are scored.
            init_from: the cross-validation whose weights the trainings begin with.

        Raises:
            ConfigurationError: the folder has something else in it, or it cannot be written, or
                two folds would have the same folder.
        """
        facts = {
            "budget": dataclasses.asdict(budget),
            "stride_s": stride_s,
            "trackers": list(trackers),
            "init_from": init_from and str(init_from),
            "folds": {fold.name: [site.name for site in fold.sites] for fold in folds},
            "sites": {s.name: list(s.recordings) for fold in folds for s in fold.sites},
            "recordings": {item.name: item.recording.sha256 for item in recordings},
        }
        self.require_usable()
        self._require_own_folders(folds)
        if self.holds_one:
            self._check_same(config, facts)
            return
        with new_folder(self.path) as folder:  # what is killed in between could not be continued
            write_text(folder / self._config.name, dump_config(config))
            write_text(folder / self._facts.name, _json({**facts, "versions": versions()}))

    def _require_own_folders(self, folds: Sequence[Fold]) -> None:
        names: dict[Path, str] = {}
        for fold in folds:
            other = names.setdefault(self.fold(fold.name).path, fold.name)
            if other != fold.name:
                raise ConfigurationError(
                    f"the folds {other!r} and {fold.name!r} would have the same folder, "
                    f"{self.fold(fold.name).path.name}, expected other names (crossval.folds or "
                    "crossval.sites)"
                )

    def _check_same(self, config: TrainingConfig, facts: Json) -> None:
        stored = load_config(self._config)
        stored = dataclasses.replace(
            stored, trainer=config.trainer, num_threads=config.num_threads
        )
        if stored != config:
            raise ConfigurationError(
                f"the configuration differs from {self._config} in "
                f"{first_difference(stored, config)}, expected the same or another --out"
            )
        long = ("folds", "sites", "recordings")
        require_same_facts(self._stored_facts(), facts, self._facts, long)

    def _stored_facts(self) -> Json:
        """Return what determines the results, as it was stored at the start.

        Raises:
            ConfigurationError: an earlier version wrote it.
        """
        facts = read_json(self._facts, "what determines the results of a cross-validation")
        if "folds" not in facts:
            raise ConfigurationError(
                f"{self.path} is of an earlier version, which has no scores by site, expected a "
                "cross-validation of this version"
            )
        return facts

    def results(self) -> Json:
        """Return the results of the folds that are done.

        ``folds`` has them in the order of the folds, ``mean_of_sites`` is the mean over the sites
        of all of them.

        Raises:
            ConfigurationError: an earlier version wrote the folder.
        """
        facts = self._stored_facts()
        keys = ("fold", "sites", "training")
        folds = [
            read_json(fold.scores, "the scores of a fold", keys)
            for fold in map(self.fold, facts["folds"])
            if fold.done
        ]
        sites = [site["scores"] for fold in folds for site in fold["sites"].values()]
        return {
            "budget": facts["budget"],
            "stride_s": facts["stride_s"],
            "trackers": facts["trackers"],
            "sites": facts["sites"],
            "left_out_together": facts["folds"],
            "folds": folds,
            "mean_of_sites": {
                tracker: pooled_scores([scores[tracker] for scores in sites])
                for tracker in facts["trackers"]
            },
            "versions": facts["versions"],
        }

    def calibration(self) -> Table | None:
        """Return what a calibration brings to each site, fitted to the other sites that are done.

        None with fewer than two sites with samples.
        """
        folds = map(self.fold, self._stored_facts()["folds"])
        files = [fold.samples for fold in folds if fold.done]
        parts = [CalibrationSamples.load(file) for file in files if file.is_file()]
        if len({name for part in parts for name in part.sites}) < 2:
            return None
        samples = merge_samples(parts)
        return calibration_table(samples, leave_one_site_out(samples))

    def write_results(self) -> Json:
        """Write and return :meth:`results`."""
        content = self.results()
        write_text(self.result, _json(content))
        parts = [to_markdown(trainings_table(content))]
        for tracker in content["mean_of_sites"]:
            table = to_markdown(scores_table(content, tracker, manoeuvres=True, brier=True))
            parts.append(f"Observations: {tracker}\n\n{table}")
        calibrated = self.calibration()
        if calibrated is not None:
            parts.append(f"{CALIBRATION_HEADING}\n\n{to_markdown(calibrated)}")
        write_text(self.markdown, "\n\n".join([*parts, NOTE]) + "\n")
        return content


def read_results(path: Path) -> Json:
    """Return the results of a cross-validation.

    Args:
        path: its folder.

    Raises:
        ConfigurationError: it holds none, an earlier version wrote it, or no fold of it is done.
    """
    folder, none = CrossvalFolder(path), f"{path} holds no cross-validation"
    if not folder.holds_one:
        raise ConfigurationError(f"{none}, expected a folder written by mtpgo crossval")
    try:
        content = folder.results()
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ConfigurationError(
            f"{none} that can be read, expected a folder written by mtpgo crossval"
        ) from error
    if not content["folds"]:
        raise ConfigurationError(f"no fold of {path} is done, expected at least one")
    return content


def _json(content: Json) -> str:
    return json.dumps(content, indent=2, allow_nan=False) + "\n"
