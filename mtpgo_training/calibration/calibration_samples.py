# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a calibration is fitted to: the errors of predictions in units of their covariances."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import astuple, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.quality.metrics import (
    Array,
    Mask,
    mahalanobis,
    mixture_nll,
    nees,
    scored_steps,
)
from mtpgo_core.schema import BoolArray, Float32Array, IndexArray
from mtpgo_core.task.calibration import Calibration, GroupArray
from mtpgo_training.atomic_files import replacing
from mtpgo_training.evaluation.honesty.mode_weights import average_distance

SAMPLES_FILE = "calibration.npz"
"""Name of the file of samples in the folder of a cross-validation's fold."""

_FORMAT = 2
_OF_HEAVIEST = ("site", "group", "distance", "log_determinant", "log_weight", "mode_error")
_OF_MODES = ("mode_distance", "mode_log_determinant")
_STORED = (*_OF_HEAVIEST, *_OF_MODES)
_ARRAYS = (*_STORED, "sigma_factor_50")


@dataclass(frozen=True)
class SampledRecording:
    """A recording that samples are of.

    Attributes:
        name: of the recording.
        source: last part of its directory's name.
        layout: of its files.
        sha256: of its files.
    """

    name: str
    source: str
    layout: str
    sha256: str


@dataclass(frozen=True)
class CalibrationSamples:
    """Predictions of n agents (a road user at an instant), compared with what they did.

    Attributes:
        step_s: time between two horizon steps (s).
        sites: names of the sites.
        site: [n] position in ``sites``.
        group: [n] position in :data:`~mtpgo_core.task.calibration.GROUPS`.
        distance: [n, H] squared Mahalanobis distance of the truth from the heaviest mode, NaN
            where the truth is not known.
        log_determinant: [n, H] of the heaviest mode's covariance (m^4).
        log_weight: [n, M] logarithms of the mode weights.
        mode_error: [n, M] distance of each mode from the truth, averaged over the known steps
            (m); NaN for agents that are not known at the last step.
        mode_distance: [n, M, K] squared Mahalanobis distance of the truth from each mode at the K
            steps of :func:`~mtpgo_core.quality.metrics.scored_steps`; NaN where the truth is not
            known, and throughout in samples that an earlier version wrote.
        mode_log_determinant: [n, M, K] of each mode's covariance there (m^4).
        sigma_factor_50: [n, H] of the 50 % ellipses, see
            :class:`~mtpgo_core.schema.Prediction`; 1 without a calibration, and not stored.
        recordings: that the samples are of, as far as it is known.
    """

    step_s: float
    sites: tuple[str, ...]
    site: NDArray[np.int32]
    group: GroupArray
    distance: Float32Array
    log_determinant: Float32Array
    log_weight: Float32Array
    mode_error: Float32Array
    mode_distance: Float32Array
    mode_log_determinant: Float32Array
    sigma_factor_50: Float32Array = field(default_factory=lambda: np.empty((0, 0), np.float32))
    recordings: tuple[SampledRecording, ...] = ()

    def __post_init__(self) -> None:
        if self.sigma_factor_50.shape != self.distance.shape:
            object.__setattr__(self, "sigma_factor_50", np.ones_like(self.distance))

    def __len__(self) -> int:
        return self.site.shape[0]

    @classmethod
    def of(
        cls,
        mean: Array,
        weight: Array,
        covariance: Array,
        truth: Array,
        mask: Mask,
        *,
        group: GroupArray,
        step_s: float,
        sites: Sequence[str],
        site: NDArray[np.integer] | int = 0,
    ) -> CalibrationSamples:
        """Compare predictions that are not calibrated with the truth.

        Predictions that are calibrated already are compared in the same way;
        :meth:`uncalibrated` then takes the calibration back.

        Args:
            mean: [n, M, H, 2] (m).
            weight: [n, M].
            covariance: [n, M, H, 2, 2] (m^2).
            truth: [n, H, 2] (m).
            mask: [n, H] where the truth is known.
            group: [n] of :func:`~mtpgo_core.task.calibration.calibration_groups`.
            step_s: time between two horizon steps (s).
            sites: names of sites.
            site: [n] position of each agent's site there, or of all.
        """
        best = np.argmax(weight, axis=1)
        chosen = covariance[np.arange(len(best)), best].astype(np.float64)
        determinant = chosen[..., 0, 0] * chosen[..., 1, 1] - chosen[..., 0, 1] ** 2
        squared = nees(mean, weight, covariance, truth)
        average = average_distance(mean, truth, mask)
        with np.errstate(divide="ignore", invalid="ignore"):
            log_determinant = np.log(determinant)
            log_weight = np.log(weight)
        usable = mask & np.isfinite(squared) & np.isfinite(log_determinant)
        steps = list(scored_steps(mask.shape[1], step_s).values())
        of_modes, spread = mahalanobis(
            truth[:, None, steps] - mean[:, :, steps], covariance[:, :, steps]
        )
        return cls(
            step_s=step_s,
            sites=tuple(sites),
            site=np.broadcast_to(np.asarray(site, dtype=np.int32), best.shape).copy(),
            group=group.astype(np.uint8),
            distance=np.where(usable, squared, np.nan).astype(np.float32),
            log_determinant=log_determinant.astype(np.float32),
            log_weight=log_weight.astype(np.float32),
            mode_error=np.where(mask[:, -1:], average, np.nan).astype(np.float32),
            mode_distance=np.where(usable[:, None, steps], of_modes, np.nan).astype(np.float32),
            mode_log_determinant=spread.astype(np.float32),
        )

    @property
    def steps(self) -> dict[float, int]:
        """The steps of ``mode_distance`` by the time ahead (s)."""
        return scored_steps(self.distance.shape[1], self.step_s)

    @property
    def nll(self) -> Array:
        """[n, K] negative log-likelihood of the truth under the mixture (nats), NaN if unknown."""
        return mixture_nll(
            self.log_weight.astype(np.float64),
            self.mode_distance.astype(np.float64),
            self.mode_log_determinant.astype(np.float64),
        )

    def select(self, rows: BoolArray | IndexArray) -> CalibrationSamples:
        """Return some of the agents; the names of the sites stay."""
        return dataclasses.replace(self, **{name: getattr(self, name)[rows] for name in _ARRAYS})

    def of_site(self, name: str) -> CalibrationSamples:
        """Return the agents of one site."""
        return self.select(self.site == self.sites.index(name))

    def without_site(self, name: str) -> CalibrationSamples:
        """Return the agents of all other sites."""
        return self.select(self.site != self.sites.index(name))

    def thinned(self, most: int) -> CalibrationSamples:
        """Return at most ``most`` agents of each site, evenly spread over their order."""
        rows = []
        for site in range(len(self.sites)):
            index = np.flatnonzero(self.site == site)
            if len(index) > most:
                index = index[np.arange(most) * len(index) // most]
            rows.append(index)
        kept = np.sort(np.concatenate(rows)) if rows else np.empty(0, dtype=np.intp)
        return self.select(kept)

    def calibrated(self, calibration: Calibration) -> CalibrationSamples:
        """Return what the samples would be if the predictions were calibrated."""
        if calibration.is_none:
            return self
        calibrated = self._scaled(calibration.factor_table, calibration.inverse_temperatures)
        factor = calibration.sigma_factor_50_table[self.group].astype(np.float32)
        return dataclasses.replace(calibrated, sigma_factor_50=factor)

    def uncalibrated(self, calibration: Calibration) -> CalibrationSamples:
        """Return what the samples of calibrated predictions would be without the calibration."""
        if calibration.is_none:
            return self
        plain = self._scaled(
            1.0 / calibration.factor_table, 1.0 / calibration.inverse_temperatures
        )
        return dataclasses.replace(plain, sigma_factor_50=np.ones_like(self.distance))

    def _scaled(self, factors: Array, powers: Array) -> CalibrationSamples:
        """Return samples with covariances times [groups, H] and weights to the power [groups]."""
        factor = factors[self.group]
        with np.errstate(invalid="ignore"):
            log_weight = self.log_weight * powers[self.group][:, None]
            total = np.logaddexp.reduce(log_weight.astype(np.float64), axis=1, keepdims=True)
        of_modes = factor[:, None, list(self.steps.values())]
        return dataclasses.replace(
            self,
            distance=(self.distance / factor).astype(np.float32),
            log_determinant=(self.log_determinant + 2.0 * np.log(factor)).astype(np.float32),
            log_weight=(log_weight - total).astype(np.float32),
            mode_distance=(self.mode_distance / of_modes).astype(np.float32),
            mode_log_determinant=(self.mode_log_determinant + 2.0 * np.log(of_modes)).astype(
                np.float32
            ),
        )

    def save(self, path: Path) -> None:
        """Write the samples to a file, atomically.

        Raises:
            ConfigurationError: it cannot be written.
        """
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.savez(
                file,
                format=np.array(_FORMAT),
                step_s=np.array(self.step_s),
                sites=np.array(self.sites, dtype=np.str_),
                recordings=np.array(list(map(astuple, self.recordings)), dtype=np.str_),
                **{name: getattr(self, name) for name in _STORED},
            )

    @classmethod
    def load(cls, path: Path) -> CalibrationSamples:
        """Read samples from a file.

        Samples of format 1 have nothing of the modes but the heaviest: the likelihood of their
        mixture is NaN.

        Raises:
            ConfigurationError: it cannot be read or holds no samples of this format.
        """
        try:
            with np.load(path, allow_pickle=False) as data:
                version = int(data["format"])
                if version not in (1, _FORMAT):
                    raise ConfigurationError(
                        f"{path} has samples of format {version}, expected 1 or {_FORMAT}"
                    )
                names = _OF_HEAVIEST if version == 1 else _STORED
                arrays = {name: data[name] for name in names}
                step_s = float(data["step_s"])
                if version == 1:
                    steps = scored_steps(arrays["distance"].shape[1], step_s)
                    shape = (*arrays["log_weight"].shape, len(steps))
                    arrays |= {name: np.full(shape, np.nan, np.float32) for name in _OF_MODES}
                # Files of earlier versions do not say.
                listed = data.get("recordings", ())
                return cls(
                    step_s=step_s,
                    sites=tuple(map(str, data["sites"])),
                    recordings=tuple(SampledRecording(*map(str, row)) for row in listed),
                    **arrays,
                )
        except FileNotFoundError as error:
            raise ConfigurationError(f"the file of samples {path} does not exist") from error
        except ConfigurationError:
            raise
        except Exception as error:  # whatever numpy and zipfile raise on a damaged file
            reason = " ".join(str(error).split())[:120]
            raise ConfigurationError(
                f"{path} holds no samples for a calibration ({reason}), expected "
                f"{SAMPLES_FILE} of a cross-validation's fold"
            ) from error


def merge_samples(parts: Sequence[CalibrationSamples]) -> CalibrationSamples:
    """Return the agents of all parts; sites of the same name are one.

    Raises:
        ConfigurationError: the parts are of models with another horizon or number of modes, or
            there is none.
    """
    if not parts:
        raise ConfigurationError("there are no samples for a calibration, expected at least one")
    shapes = {(part.step_s, part.distance.shape[1], part.log_weight.shape[1]) for part in parts}
    if len(shapes) > 1:
        listed = ", ".join(f"{h} steps of {s:g} s, {m} modes" for s, h, m in sorted(shapes))
        raise ConfigurationError(
            f"the samples for the calibration are of different models ({listed}), expected the "
            "same horizon and number of modes"
        )
    sites = tuple(dict.fromkeys(name for part in parts for name in part.sites))
    place = {name: index for index, name in enumerate(sites)}
    moved = [np.array([place[name] for name in part.sites], dtype=np.int32) for part in parts]
    joined = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in _ARRAYS[1:]
    }
    site = np.concatenate([to[part.site] for to, part in zip(moved, parts, strict=True)])
    recordings = tuple(dict.fromkeys(one for part in parts for one in part.recordings))
    return CalibrationSamples(
        step_s=parts[0].step_s, sites=sites, site=site, recordings=recordings, **joined
    )


def load_samples(paths: Sequence[Path]) -> CalibrationSamples:
    """Return the samples in files, and in all files ``calibration.npz`` below folders.

    Raises:
        ConfigurationError: a path does not exist, a folder holds no samples, a file is unusable,
            or they do not fit together.
    """
    files: list[Path] = []
    for path in paths:
        if not path.is_dir():
            files.append(path)
            continue
        found = sorted(path.rglob(SAMPLES_FILE))
        if not found:
            raise ConfigurationError(
                f"{path} holds no {SAMPLES_FILE}, expected the folder of a cross-validation"
            )
        files += found
    return merge_samples([CalibrationSamples.load(file) for file in dict.fromkeys(files)])
