# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The names of the files in the folder of a training run.

Nothing is imported here, so that a command can look for a run before it loads PyTorch.
"""

CONFIG_FILE = "config.yaml"
"""The run's configuration, written at its start."""

FACTS_FILE = "run.json"
"""Data hashes, splits, versions and seed, written at its start; a folder with it holds a run."""

PLAN_FILE = "plan.json"
"""Schedule that was made for a time limit."""

LOG_FILE = "log.csv"
"""A line per epoch."""

RANGE_TEST_FILE = "learning_rate_test.csv"
"""Points of the range test of the learning rate."""

BEST_FILE = "best.pt"
"""Checkpoint of the best epoch by validation."""

LAST_FILE = "last.pt"
"""Checkpoint that an interrupted run is resumed from."""

SAMPLES_FILE = "validation.npz"
"""Samples of the validation of :data:`BEST_FILE`, to which a calibration is fitted."""

KEPT_FILES = {BEST_FILE: "best_epoch.pt", SAMPLES_FILE: "best_epoch.npz"}
"""What was the best before a part of an epoch was, at a time limit -> where it is until the run is
resumed, which goes on from it."""

RUN_FILES = (
    *(CONFIG_FILE, FACTS_FILE, PLAN_FILE, LOG_FILE, RANGE_TEST_FILE),
    *(BEST_FILE, LAST_FILE, SAMPLES_FILE, *KEPT_FILES.values()),
)
"""All of them; ``tensorboard/`` beside them is a folder."""
