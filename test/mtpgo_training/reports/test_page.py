# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page of the report; the whole page is tested with the command."""

import time

import pytest
from headless_browser import HeadlessBrowser, find_browser

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.reports import page
from mtpgo_training.reports.page import prepare_folder, render_page
from mtpgo_training.table_format import Cell, Row, Table


def test_the_folder_is_created_or_refused(tmp_path):
    prepare_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigurationError, match="is a file, expected a folder"):
        prepare_folder(tmp_path / "file")


def test_the_subtitle_names_the_first_twelve_recordings():
    names = [f"{i:02d}" for i in range(1, 15)]
    for count, text in (
        (1, "On 1 recording: 01."),
        (12, f"On 12 recordings: {', '.join(names[:12])}."),
        (14, f"On 14 recordings: {', '.join(names[:12])} and 2 more."),
    ):
        assert page._subtitle({"recordings": dict.fromkeys(names[:count], "")}) == text


def test_the_facts_say_what_was_evaluated():
    content = {
        "weights": {"m": "0123456789abcdef0123"},
        "tasks": {"m": {"policy": "cover", "max_neighbours": 16, "radius_m": 60.0}},
        "recordings": {"01": "fedcba98765432100123"},
        "policy": None,
        "stride_s": 0.2,
        "layout": ["highd"],
        "min_future_s": 0.0,
        "one_sample": False,
        "tracker": "recorded",
        "tracker_seed": None,
    }
    assert page._facts(content) == [
        ("m", "weights 0123456789abcdef, policy cover, up to 16 neighbours within 60 m"),
        ("layout", "highd"),
        ("instants", "every 0.2 s"),
        ("least future", "0 s"),
        ("recording 01", "SHA-256 fedcba9876543210"),
    ]
    changed = {"policy": "each", "stride_s": None, "layout": [], "one_sample": True}
    changed |= {
        "trails": False,
        "tracker": "simulated",
        "tracker_seed": 4,
        "unknown_classes": True,
        "path_smoothing_s": 0.4,
    }
    facts = dict(page._facts(content | changed))
    assert facts["observations"] == "of a simulated tracker, seed 4"
    assert facts["classes"] == "every road user was observed as one of an unknown class"
    assert facts["paths"] == "smoothed with a memory of 0.4 s"
    assert facts["trails"] == "no earlier road user was known"
    assert "policy each" in facts["m"]
    assert facts["layout"] == "the bag's own observations"
    assert facts["instants"] == "those of the bag"
    assert facts["past"].startswith("forgotten before each instant")


def test_a_models_name_becomes_a_file_name():
    assert page._file_name("runs/my model-1.0_b") == "runs_my_model-1.0_b"


WIDE = Table(
    ["", *["95% 5s"] * 9, *["sigma (RMSE) 5s"] * 3, *["ratio 5s"] * 6, "agents"],
    [Row("standing: default", ["0.524 (0.801)"] * 12 + ["-1.17"] * 6 + ["2958"], "#000000")],
    heading="Coverage",
)
RESULTS = Table(
    ["", *["minFDE m"] * 8, *["moving 90% 5s"] * 3, "agents", "ADE / cv"],
    [Row("default", [Cell("0.774", "-0.65 to 1.93")] * 11 + ["5522", Cell("1.48", "1.1 to 1.7")])],
    heading="Results",
)
HIDDEN = """(() => {
  document.querySelectorAll("details").forEach(one => one.open = true);
  const cards = [...document.querySelectorAll(".card")];
  const ways = new Set(cards.map(one => getComputedStyle(one).overflowX));
  return document.readyState + " " + cards.length + " " + [...ways] + " "
    + cards.filter(one => one.scrollWidth > one.clientWidth).length;
})()"""


@pytest.mark.skipif(find_browser() is None, reason="no Chromium or Chrome is installed")
def test_no_column_of_a_wide_table_is_out_of_sight(tmp_path):
    path = tmp_path / "index.html"
    render_page(
        path, title="t", subtitle="", tables=[RESULTS, WIDE], folded=[WIDE], figures={}, facts=[]
    )
    browser = HeadlessBrowser(tmp_path / "profile", (1200, 900))
    try:
        browser.call("Page.navigate", url=path.as_uri())
        end = time.monotonic() + 60.0
        found = ""
        while not found.startswith("complete 5 ") and time.monotonic() < end:
            time.sleep(0.1)
            answer = browser.call("Runtime.evaluate", expression=HIDDEN, returnByValue=True)
            found = answer["result"]["value"]
    finally:
        browser.close()
    assert found == "complete 5 auto 0"
