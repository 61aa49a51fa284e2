# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Scenes for training and validation, cut by the functions that the node uses.

A sample is one graph as a ``torch_geometric`` Data whose nodes are the agents; PyG's DataLoader
batches graphs of different sizes and :func:`dense` lays them out for the model.
"""

from __future__ import annotations

import copy
import dataclasses
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset
from torch_geometric.data import Batch, Data
from torch_geometric.utils import to_dense_batch

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.frames import rotate
from mtpgo_core.scene.graph_selection import GraphState
from mtpgo_core.scene.scene_builder import build_scenes, class_one_hot
from mtpgo_core.scene.trails.trail_context import TrailContext
from mtpgo_core.schema import AgentClass, Float32Array, Float64Array, HistoryWindow, SceneBatch
from mtpgo_core.task.calibration import calibration_groups
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.scenes.augmentation import Augmentation
from mtpgo_training.scenes.centre_sampling import copies, draw_cover, graph_sizes, standing
from mtpgo_training.scenes.kinematic_baselines import predict_baselines
from mtpgo_training.scenes.lane_change_balancing import balanced_copies, draw_balanced
from mtpgo_training.scenes.pairs.scene_pair import (
    alone,
    are_steps_apart,
    is_compared,
    paired,
    present_row,
    steps_between_windows,
)
from mtpgo_training.scenes.prepared_recording import (
    RECORDED,
    RESTARTED,
    TRACKED,
    PreparedRecording,
    View,
)
from mtpgo_training.scenes.windows import TrackedWindow


@dataclass(frozen=True)
class Item:
    """The graph of a sample.

    Attributes:
        source: index of its recording.
        window: index of its window there.
        centre: row of its centre there.
        agents: number of agents in it.
        view: number of its view of the recording, see
            :mod:`mtpgo_training.scenes.prepared_recording`.
        augmentation: see :class:`~mtpgo_training.scenes.augmentation.Augmentation`.
        trails_age: how far back trails are known, as a share of the time since the recording's
            start: 0 for none, 1 for all.
        unknown_seed: classes are hidden, see :func:`hide_classes`; None if they are not.
    """

    source: int
    window: int
    centre: int
    agents: int
    view: int
    augmentation: Augmentation
    trails_age: float = 1.0
    unknown_seed: int | None = None


class SceneDataset(Dataset[Data]):
    """Training graphs; each epoch draws new centres such that every agent is in a graph."""

    def __init__(
        self,
        sources: Sequence[PreparedRecording],
        history: HistoryConfig,
        scene: SceneConfig,
        data: DataConfig,
        horizon_steps: int,
        seed: int,
        *,
        pairs: bool = False,
    ) -> None:
        """Draw the first epoch.

        Args:
            sources: prepared recordings.
            history: grid of the window and of the future.
            scene: size of the graphs, frame and features.
            data: augmentation.
            horizon_steps: H.
            seed: the draws depend on it and on the epoch only.
            pairs: a sample also holds what is observed of its agents in the next window, see
                :func:`mtpgo_training.scenes.pairs.scene_pair.paired`.

        Raises:
            ConfigurationError: with ``pairs``, windows that cannot be compared.
        """
        self.sources = list(sources)
        self.history = history
        self.scene = scene
        self.data = data
        self.horizon_steps = horizon_steps
        self.seed = seed
        self.pairs = pairs
        if pairs:
            self._pair_steps = steps_between_windows(data.stride_s, history.dt_s, horizon_steps)
            self._require_pairs()
        self.items: list[Item] = []
        self._at_site = [scene_at(source, scene) for source in self.sources]
        self._copies = None
        if data.lane_change_share > 0.0:
            found = [
                (s.changes, s.chance * s.weight) for s in self.sources if s.changes is not None
            ]
            share, copies_each = data.lane_change_share, data.lane_change_copies
            self._copies = balanced_copies(found, share, copies_each)
        self.set_epoch(0)

    def _require_pairs(self) -> None:
        for source in self.sources:
            stamps = source.windows.instants.stamp_ns.tolist()
            for stamp, later in itertools.pairwise(stamps):
                if are_steps_apart(stamp, later, self.history.dt_s, self._pair_steps):
                    return
        raise ConfigurationError(
            f"optimisation.consistency_weight is above 0 but no recording of data.train has two "
            f"windows {self.data.stride_s:g} s (data.stride_s) apart, expected recordings with a "
            "frame at such times, or optimisation.consistency_weight=0"
        )

    def set_epoch(self, epoch: int) -> None:
        """Draw the graphs of an epoch (counted from 0), in the order of the recordings."""
        rng = np.random.default_rng([self.seed, epoch])
        self.items = []
        for s, source in enumerate(self.sources):
            for w in range(len(source.windows)):
                for _ in range(copies(source.weight, rng)):
                    self.items.extend(self._draw(s, w, source, rng))

    def _draw(
        self, s: int, w: int, source: PreparedRecording, rng: np.random.Generator
    ) -> list[Item]:
        """Draw the graphs of one window."""
        view = self._draw_view(source, rng)
        candidates = source.candidates(w, view)
        items = []
        if self._copies is None:
            centres = draw_cover(candidates, self.scene, rng)
        else:
            centres = draw_balanced(candidates, self._copies, rng)
        sizes = graph_sizes(candidates, centres, self.scene)
        for centre, agents in zip(centres.tolist(), sizes.tolist(), strict=True):
            mirror = bool(rng.random() < self.data.mirror_probability)
            turn = float(rng.normal(0.0, 1.0)) * self.data.rotation_std_rad
            scale = float(np.exp(rng.normal(0.0, 1.0) * self.data.scale_std))
            change = Augmentation(mirror, turn, scale)
            age = self._trails_age(rng) if self.scene.trails else 1.0
            unknown_seed, share = None, self.data.unknown_class_share
            if share > 0.0 and rng.random() < share:
                unknown_seed = int(rng.integers(1 << 32))
            items.append(Item(s, w, centre, agents, view, change, age, unknown_seed))
        return items

    def _trails_age(self, rng: np.random.Generator) -> float:
        """Draw how far back the trails of a graph are known."""
        kind, age = rng.random(), float(rng.random())
        if kind < self.data.trails_none_probability:
            return 0.0
        some = self.data.trails_none_probability + self.data.trails_partial_probability
        return age if kind < some else 1.0

    def _draw_view(self, source: PreparedRecording, rng: np.random.Generator) -> int:
        """Draw which view of a recording a window is cut from."""
        if source.tracked and rng.random() < self.data.tracker_share:
            return TRACKED + int(rng.integers(len(source.tracked)))
        restarted = source.restarted is not None and rng.random() < self.data.restart_probability
        return RESTARTED if restarted else RECORDED

    def without_pairs(self) -> SceneDataset:
        """Return the same samples without the fields of the next window."""
        single = copy.copy(self)
        single.pairs = False
        return single

    def __len__(self) -> int:
        return len(self.items)

    def __getitem__(self, index: int) -> Data:
        item = self.items[index]
        source = self.sources[item.source]
        view = source.views[item.view]
        tracked = view.windows[item.window]
        batch = self._graph(item, tracked, item.centre)
        data = scene_data(
            batch,
            0,
            tracked,
            source,
            self.scene,
            self.history.dt_s,
            self.horizon_steps,
            augmentation=item.augmentation,
            standing_weight=self.data.standing_weight,
            unknown_seed=item.unknown_seed,
        )
        if self.pairs:
            for name, value in self._later(data, batch, tracked, item).items():
                data[name] = value
        return data

    def _graph(self, item: Item, tracked: TrackedWindow, centre: int) -> SceneBatch:
        """Return the graph around a row of a window of the item's view."""
        source = self.sources[item.source]
        view = source.views[item.view]
        trails = trail_context(
            source, view, tracked, self.horizon_steps, self.history.dt_s, item.trails_age
        )
        return build_scenes(
            with_own_keys(tracked, source),
            self._at_site[item.source],
            centres=np.array([centre]),
            lanes=source.lanes,
            trails=trails,
        )

    def _later(
        self, data: Data, batch: SceneBatch, tracked: TrackedWindow, item: Item
    ) -> dict[str, Tensor]:
        """Return the fields of an item's agents in the next window.

        No agent is in both windows if there is no next window at the right time, or if the centre
        is not in it.
        """
        windows = self.sources[item.source].views[item.view].windows
        if item.window + 1 >= len(windows):
            return alone(data)
        later = windows[item.window + 1]
        track = tracked.track[batch.agent[0]]
        centre = present_row(later, int(track[0]))
        stamps = tracked.window.stamp_ns, later.window.stamp_ns
        if centre is None or not are_steps_apart(*stamps, self.history.dt_s, self._pair_steps):
            return alone(data)
        later_batch = self._graph(item, later, centre)
        return paired(
            batch,
            track,
            later_batch,
            later.track[later_batch.agent[0]],
            item.augmentation,
            self.scene.features,
            is_compared(tracked.window)[batch.agent[0]],
        )


def validation_scenes(
    sources: Sequence[PreparedRecording],
    history: HistoryConfig,
    scene: SceneConfig,
    horizon_steps: int,
) -> list[Data]:
    """Return the graphs that the node would cut under ``scene.policy``, with their baselines.

    They are cut from the recorded observations and, where there are any, from those of the
    simulated trackers. As in the node, each window keeps the centres of the one before that are
    still useful. ``primary`` marks the graph whose prediction would be published for an agent, so
    every agent counts once; ``centre`` marks the agents in the centres of the graphs. ``group``
    [N] is their group in a calibration, and ``site`` of a scene is the name of its site.
    """
    scenes = []
    for source in sources:
        own = scene_at(source, scene)
        for view in (source.views[RECORDED], *source.tracked):
            previous = GraphState()
            for tracked in view.windows:
                trails = trail_context(source, view, tracked, horizon_steps, history.dt_s)
                batch = build_scenes(
                    tracked.window, own, previous=previous, lanes=source.lanes, trails=trails
                )
                for b in range(batch.features.shape[0]):
                    scenes.append(
                        _with_baselines(batch, b, tracked, source, scene, history, horizon_steps)
                    )
    return scenes


def scene_at(source: PreparedRecording, scene: SceneConfig) -> SceneConfig:
    """Return the scene configuration with the origin of a recording's site.

    Raises:
        ConfigurationError: there are origins by site, and none for this one.
    """
    try:
        return scene.at_site(source.recording.location)
    except ConfigurationError as error:
        raise ConfigurationError(f"recording {source.recording.name}: {error}") from error


def _with_baselines(
    batch: SceneBatch,
    b: int,
    tracked: TrackedWindow,
    source: PreparedRecording,
    scene: SceneConfig,
    history: HistoryConfig,
    horizon_steps: int,
) -> Data:
    """Return :func:`scene_data` with ``baselines`` [N, baselines, H, 2], groups and site."""
    data = scene_data(batch, b, tracked, source, scene, history.dt_s, horizon_steps)
    agents = batch.agent[b][batch.agent[b] >= 0]
    window = tracked.window.select(agents)
    own = predict_baselines(window, horizon_steps, history.dt_s)
    paths = np.stack([path.position for path in own.values()], axis=1)
    local = to_scene(paths - batch.origin[b], batch.rotation[b])
    data.baselines = torch.from_numpy(np.nan_to_num(local).astype(np.float32))
    group = calibration_groups(window.agent_class, window.velocity[:, -1])
    data.group = torch.from_numpy(group)
    data.site = source.site
    return data


def trail_context(
    source: PreparedRecording,
    view: View,
    tracked: TrackedWindow,
    horizon_steps: int,
    dt_s: float,
    age: float = 1.0,
) -> TrailContext | None:
    """Return the trails of a window's recording, None if the task has none.

    Args:
        source: the recording.
        view: the view of it that the window is cut from.
        tracked: the window.
        horizon_steps: H.
        dt_s: step of the horizon (s).
        age: how far back they are known, as a share of the time since the recording's start.
    """
    if view.trails is None:
        return None
    since_ns = None
    if age < 1.0:
        now_ns = tracked.window.stamp_ns
        start_ns = source.recording.span_ns[0]
        # What becomes known at t itself does not count as known at the age 0.
        since_ns = now_ns + 1 - round(age * (now_ns - start_ns))
    return TrailContext(view.trails, horizon_steps, dt_s, since_ns)


def with_own_keys(tracked: TrackedWindow, source: PreparedRecording) -> HistoryWindow:
    """Return the window with the keys that its road users have in the recording.

    Pieces of tracks have keys of their own, with which an agent's own trail would count as that of
    another road user.
    """
    if source.trails is None:
        return tracked.window
    return dataclasses.replace(tracked.window, key=source.recording.key[tracked.track])


def scene_data(
    batch: SceneBatch,
    b: int,
    tracked: TrackedWindow,
    source: PreparedRecording,
    scene: SceneConfig,
    dt_s: float,
    horizon_steps: int,
    *,
    augmentation: Augmentation | None = None,
    standing_weight: float = 1.0,
    unknown_seed: int | None = None,
) -> Data:
    """Return graph ``b`` of a batch as PyG Data.

    The nodes are the N agents; ``x`` [N, T, F], ``valid`` [N, T], ``static`` [N, C], ``target``
    [N, H, 4] (x, y, vx, vy in the scene frame; zero where not observed), ``weight`` [N, H] (0
    where not observed or where the agent is not valid at t), ``primary`` [N], ``centre`` [N] and,
    if the task has trails, ``trails`` [N, R, H, 3].
    """
    there = batch.agent[b] >= 0
    agents = batch.agent[b][there]
    future = source.future.at(tracked.track[agents], tracked.window.stamp_ns, horizon_steps, dt_s)
    rotation = float(batch.rotation[b])
    position = to_scene(future.position - batch.origin[b], rotation)
    velocity = to_scene(future.velocity, rotation)
    features, valid = batch.features[b][there], batch.valid[b][there]
    static = batch.static[b][there]
    if augmentation is not None and not augmentation.is_none:
        features = augmentation.features(features, scene.features)
        static = augmentation.static(static, scene.static_features)
        features[~valid] = 0.0
        position = augmentation.vectors(position)
        velocity = augmentation.vectors(velocity)
    known = future.known & valid[:, -1:]
    target = np.where(known[..., None], np.concatenate([position, velocity], axis=-1), 0.0)
    weight = known.astype(np.float32)
    if standing_weight < 1.0:
        weight[standing(features, target, known)] *= standing_weight
    if unknown_seed is not None:
        static = hide_classes(static, scene.classes, unknown_seed)
    data = Data(
        x=torch.from_numpy(features),
        valid=torch.from_numpy(valid),
        static=torch.from_numpy(static),
        target=torch.from_numpy(target.astype(np.float32)),
        weight=torch.from_numpy(weight),
        primary=torch.from_numpy(batch.primary[b][there]),
        centre=torch.arange(len(agents)) == 0,
        num_nodes=len(agents),
    )
    if batch.trails is not None:
        trails = batch.trails[b][there]
        if augmentation is not None:
            trails = augmentation.trails(trails)
        data.trails = torch.from_numpy(trails)
    return data


def hide_classes(static: Float32Array, classes: tuple[str, ...], seed: int) -> Float32Array:
    """Return static features in which the class of all agents, or of a random half, is unknown.

    Both have the same probability; they imitate a tracker without classes and one that is often
    unsure. The columns after the classes are unchanged.

    Args:
        static: [N, C + ...] one-hot classes first.
        classes: the C classes.
        seed: seed of the draw.
    """
    rng = np.random.default_rng(seed)
    hidden = np.ones(len(static), dtype=np.bool_)
    if rng.random() < 0.5:
        hidden = rng.random(len(static)) < 0.5
    static = static.copy()
    unknown = np.array([AgentClass.UNKNOWN], dtype=np.uint8)
    static[hidden, : len(classes)] = class_one_hot(unknown, classes)
    return static


def dense(batch: Batch) -> dict[str, Tensor]:
    """Return the fields of a PyG batch as [B, N, ...], zero and false where there is no agent."""
    names = (
        "x",
        "valid",
        "static",
        "target",
        "weight",
        "primary",
        "centre",
        "baselines",
        "trails",
        "group",
        "later_x",
        "later_valid",
        "later_trails",
        "later_both",
        "later_change",
    )
    index, size = batch.batch, int(batch.num_graphs)
    return {
        name: to_dense_batch(batch[name], index, batch_size=size)[0]
        for name in names
        if name in batch
    }


def to_scene(vectors: Float64Array, rotation: float) -> Float64Array:
    """Return [..., 2] vectors of the fixed frame in a scene frame turned by ``rotation`` (rad)."""
    return rotate(vectors, -rotation)
