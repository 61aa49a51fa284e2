# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Python in the pages is run; YAML, JSON, XML and TOML can be read."""

import functools
import json
import shutil
import tomllib
from xml.etree import ElementTree

import numpy as np
import page_blocks
import pytest
import yaml
from page_blocks import PAGES, ROOT, all_blocks
from rosbags.typesys import Stores, get_typestore

from msg_adapters.predictions import prediction_to_pointcloud2
from msg_adapters.types import TypestoreTypes
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import Prediction

READERS = {
    "json": json.loads,
    "toml": tomllib.loads,
    "xml": ElementTree.fromstring,
    "yaml": lambda text: list(yaml.safe_load_all(text)),
}
LANGUAGES = {"bash", "console", "python", "sh", "text", *READERS}
BLOCKS = [block for block in all_blocks() if not block.reason]
PYTHON = [page for page in PAGES if any(b.page == page and b.language == "python" for b in BLOCKS)]


@functools.cache
def other_tests():
    """Return the tests that look at blocks of pages, by path, with their text."""
    texts = {
        path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
        for path in sorted((ROOT / "test").rglob("test_*.py"))
        if path.parent.name != "documentation"
    }
    return {path: text for path, text in texts.items() if "```" in text}


def run_elsewhere(page, language):
    """Return the tests that run the blocks of a page themselves, with what they need."""
    name, fence = f'"{page.name}"', f"```{language}"
    return [path for path, text in other_tests().items() if name in text and fence in text]


@pytest.fixture(scope="module")
def message():
    """A prediction of three road users with two modes of five steps, as the node publishes it."""
    n, modes, steps = 3, 2, 5
    mean = np.ones((n, modes, steps, 4)).cumsum(axis=2)
    prediction = Prediction(
        stamp_ns=1_700_000_000_000_000_000,
        frame_id="map",
        key=keys_from_integers([17, 18, 19]),
        agent_class=np.array([1, 2, 7], dtype=np.uint8),
        z=np.zeros(n),
        size=np.full((n, 2), 2.0),
        initial=np.zeros((n, 4)),
        initial_yaw=np.zeros(n),
        time_s=0.2 * np.arange(1, steps + 1),
        weight=np.tile([0.75, 0.25], (n, 1)),
        mean=mean,
        yaw=np.zeros((n, modes, steps)),
        covariance=np.tile(np.eye(2), (n, modes, steps, 1, 1)),
        source=np.zeros(n, dtype=np.uint8),
    )
    types = TypestoreTypes(get_typestore(Stores.ROS2_JAZZY))
    return prediction_to_pointcloud2(prediction, types)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the recordings 01 and 02 in ``highD/data``."""
    folder = tmp_path_factory.mktemp("pages")
    data = folder / "highD" / "data"
    shutil.copytree(ROOT / "resource" / "recordings" / "highway", data)
    for path in list(data.iterdir()):
        shutil.copy(path, data / path.name.replace("01_", "02_", 1))
    return folder


@pytest.mark.parametrize("page", PYTHON, ids=lambda page: page.name)
def test_python_blocks_are_run(page, message, folder, monkeypatch):
    """The blocks of a page one after the other, each with what those before it have defined."""
    others = run_elsewhere(page, "python")
    if others:
        pytest.skip(f"run by {', '.join(others)}")
    monkeypatch.chdir(folder)
    names: dict = {}
    for block in BLOCKS:
        if block.page == page and block.language == "python":
            code = compile("\n" * block.line + block.text, str(page), "exec")
            names["message"] = message
            exec(code, names)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_blocks_name_a_language_that_is_checked(page):
    for block in BLOCKS:
        if block.page == page and not run_elsewhere(page, ""):
            assert block.language in LANGUAGES, f"{block.place}: no test reads {block.language}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_blocks_of_data_can_be_read(page):
    for block in BLOCKS:
        if block.page == page and block.language in READERS:
            try:
                READERS[block.language](block.text)
            except Exception as error:
                pytest.fail(f"{block.place}: {error}")


def test_reasons_are_sentences():
    reasons = [block.reason for block in page_blocks.all_blocks() if block.reason]
    assert all(len(reason.split()) > 2 for reason in reasons)
