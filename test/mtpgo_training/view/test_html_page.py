# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page, opened in a real browser without a window."""

import base64
import dataclasses
import re

import numpy as np
import pytest
from headless_browser import HeadlessBrowser, find_browser

from mtpgo_training.view.html_page import page_text, write_page

needs_browser = pytest.mark.skipif(
    find_browser() is None,
    reason="no Chromium or Chrome is installed (Debian: apt-get install chromium)",
)

COLOURS = """(() => {
  const c = document.getElementById("view");
  const d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
  const seen = new Set();
  for (let i = 0; i < d.length; i += 4) seen.add((d[i] << 16) | (d[i + 1] << 8) | d[i + 2]);
  return seen.size;
})()"""
PICTURE = 'document.getElementById("view").toDataURL()'


def test_the_page_holds_everything(scene):
    text = page_text(dataclasses.replace(scene, name="a <b> & c"))
    assert "{{" not in text
    assert "<title>a &lt;b&gt; &amp; c" in text
    assert not re.search(r"(src|href)\s*=\s*[\"'](?!data:)", text)
    assert "default-src 'none'" in text


def test_a_name_that_looks_like_a_part_is_text(scene):
    named = page_text(dataclasses.replace(scene, name="{{data}} {{script}}"))
    assert "<title>{{data}} {{script}}: predictions over time</title>" in named
    assert len(named) < len(page_text(scene)) + 200


@pytest.fixture(scope="module")
def browser(scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("browser")
    write_page(scene, folder / "page.html")
    browser = HeadlessBrowser(folder / "profile")
    browser.open((folder / "page.html").as_uri())
    yield browser
    browser.close()


def slide(browser, time_s):
    browser.value(
        f"""(() => {{
          const s = document.getElementById("slider");
          s.value = {round(1000 * time_s)};
          s.dispatchEvent(new Event("input", {{ bubbles: true }}));
        }})()"""
    )
    browser.wait_for("!viewer.dirty")


def text(browser, name):
    return browser.value(f'document.getElementById("{name}").innerText')


def press(browser, key):
    code = {" ": ("Space", 32), "Tab": ("Tab", 9)}[key]
    for kind in ("keyDown", "keyUp"):
        browser.call(
            "Input.dispatchKeyEvent",
            type=kind,
            key=key,
            code=code[0],
            windowsVirtualKeyCode=code[1],
            **({"text": key} if kind == "keyDown" and key == " " else {}),
        )


@needs_browser
@pytest.mark.timeout(300)
class TestInABrowser:
    @pytest.fixture(autouse=True)
    def no_error(self, browser):
        yield
        assert browser.problems == []

    def test_it_draws(self, browser):
        assert browser.value(COLOURS) > 20
        assert base64.b64encode(browser.screenshot())
        assert "perfect" in text(browser, "facts")
        assert "map" in text(browser, "facts")

    def test_the_slider_moves_the_picture_and_the_scores(self, browser):
        slide(browser, 1.0)
        before = browser.value(PICTURE)
        assert "–" in text(browser, "scores")
        slide(browser, 7.0)
        assert browser.value(PICTURE) != before
        assert "0.00 m" in text(browser, "scores")
        assert text(browser, "clock").startswith("7.0 / 12.0")
        slide(browser, 1.0)
        assert browser.value(PICTURE) == before

    def test_what_is_not_known_counts_in_no_mean(self, browser):
        """Two road users at 5 s, of which one has no covariance."""
        rows = browser.value(
            """(() => {
              const agents = new Map([[0, { ade: 1, final: 2, inside: 1 }],
                [1, { ade: 3, final: 4, inside: NaN }], [2, { ade: 5, final: NaN, inside: NaN }]]);
              const timeline = new Timeline({
                frameS: new Float32Array([0, 5]), head: { horizon_s: 5 }, tracks: [],
                predictions: [{ t: 0, delay: 0, agents }],
              });
              const { all } = timeline.scoresAt(5);
              return [all.ade / all.n, all.final / all.m, all.inside / all.k];
            })()"""
        )
        assert rows == [3, 3, 1]

    def test_the_curve_does_not_lead_over_a_time_without_predictions(self, browser):
        times = browser.value(
            """(() => {
              const agents = new Map([[0, { ade: 1, final: 2, inside: 1 }]]);
              const predictions = [0, 0.2, 0.4, 60, 60.2].map((t) => ({ t, delay: 0, agents }));
              const timeline = new Timeline({
                frameS: new Float32Array([0, 90]), head: { horizon_s: 5 }, tracks: [], predictions,
              });
              return timeline.errorPieces.map((piece) => piece.map(([t]) => t));
            })()"""
        )
        np.testing.assert_allclose(times[0], [5.0, 5.2, 5.4])
        np.testing.assert_allclose(times[1], [65.0, 65.2])

    def test_a_road_user_far_away_does_not_empty_the_view(self, browser):
        found = browser.value(
            """(() => {
              const road = [...Array(50).keys()].map((i) => [4 * i, i % 3]);
              const ghosts = [[9e7, 0], [0, -1e5], [700, 2]];
              return pointsTogether([...road, ...ghosts]).map(([x]) => x);
            })()"""
        )
        assert found == [*range(0, 200, 4), 700]

    def test_slow_recordings_are_drawn_between_their_frames(self, browser):
        gaps = "[[0, 0.1, 0.2, 5], [0, 1, 2], [0]].map((t) => longestGap(new Float32Array(t)))"
        np.testing.assert_allclose(browser.value(gaps), [0.6, 1.5, 0.6])

    def test_positions_are_those_of_the_recording(self, browser, scene):
        slide(browser, 5.0)
        poses = browser.value(
            "viewer.present.map((p) => [p.track.id, p.pose.x, p.pose.y, p.pose.yaw])"
        )
        origin = browser.value("viewer.scene.head.origin")
        rows = scene.recording.frame == 50
        found = np.array([pose[1:3] for pose in poses]) + origin
        np.testing.assert_allclose(found, scene.recording.position[rows], atol=0.011)
        np.testing.assert_allclose(
            [pose[3] for pose in poses], scene.recording.yaw[rows], atol=0.011
        )
        ends = browser.value(
            """[...viewer.timeline.predictionAt(5).agents.values()].map(
              (a) => [a.modes[0].x.at(-1), a.modes[0].y.at(-1)])"""
        )
        later = scene.recording.position[scene.recording.frame == 100]
        np.testing.assert_allclose(np.array(ends) + origin, later, atol=0.03)

    def test_lanes_are_drawn_where_they_are(self, browser, scene):
        slide(browser, 1.0)
        origin = browser.value("viewer.scene.head.origin")
        (found,) = browser.value(
            "viewer.scene.lanes.map((l) => [...l.x].map((x, i) => [x, l.y[i]]))"
        )
        np.testing.assert_allclose(np.array(found) + origin, scene.recording.lanes[0], atol=0.011)
        darkest = """(() => {
          const o = viewer.scene.head.origin, r = window.devicePixelRatio || 1;
          const [x, y] = viewer.camera.toPixels(110 - o[0], %s - o[1]);
          const copy = document.createElement("canvas"), options = { willReadFrequently: true };
          const g = copy.getContext("2d", options);
          const view = document.getElementById("view");
          g.drawImage(view, Math.round(x * r) - 2, Math.round(y * r) - 2, 5, 5, 0, 0, 5, 5);
          return Math.min(...g.getImageData(0, 0, 5, 5).data.filter((_, i) => i %% 4 === 0));
        })()"""
        line = browser.value("parseInt(viewer.painter.theme.lane.slice(1, 3), 16)")
        assert browser.value(darkest % -12) <= line + 10
        assert browser.value(darkest % -15) > line + 30  # beside it

    def test_it_plays_and_pauses(self, browser):
        slide(browser, 2.0)
        browser.value('document.getElementById("play").click()')
        browser.wait_for("viewer.t > 2.3")
        browser.value('document.getElementById("play").click()')
        assert not browser.value("viewer.playing")

    def test_a_click_on_a_road_user_tells_about_it(self, browser):
        slide(browser, 3.0)
        x, y = browser.value(
            """(() => {
              const p = viewer.present[1].pose, [x, y] = viewer.camera.toPixels(p.x, p.y);
              const r = document.getElementById("view").getBoundingClientRect();
              return [x + r.left, y + r.top];
            })()"""
        )
        for kind in ("mousePressed", "mouseReleased"):
            browser.call(
                "Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1
            )
        browser.wait_for("!viewer.dirty && viewer.selected !== null")
        told = text(browser, "agent")
        assert "road user 8" in told
        assert "truck" in told
        assert "36 km/h" in told
        assert "model" in told
        assert "correction\tnone" in told

    def test_switches_keys_wheel_and_theme_change_the_picture(self, browser):
        slide(browser, 3.0)
        seen = {browser.value(PICTURE)}
        for act in (
            'document.getElementById("ellipses").click()',
            'document.dispatchEvent(new KeyboardEvent("keydown", { key: "m" }))',
            "document.getElementById('view').dispatchEvent("
            "new WheelEvent('wheel', { deltaY: -300, cancelable: true }))",
            "viewer.camera.pan(40, 0); viewer.change({})",
            'document.getElementById("theme").click()',
            'document.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }))',
        ):
            browser.value(act)
            browser.wait_for("!viewer.dirty")
            seen.add(browser.value(PICTURE))
        assert len(seen) == 7

    def test_space_plays_except_on_what_the_keyboard_has_chosen(self, browser):
        x, y = browser.value(
            """(() => {
              const r = document.getElementById("past").getBoundingClientRect();
              return [r.x + r.width / 2, r.y + r.height / 2];
            })()"""
        )
        for kind in ("mousePressed", "mouseReleased"):
            browser.call(
                "Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1
            )
        assert not browser.value('document.getElementById("past").checked')
        press(browser, " ")
        assert browser.value("viewer.playing")
        assert not browser.value('document.getElementById("past").checked')
        press(browser, " ")
        assert not browser.value("viewer.playing")
        browser.value('document.getElementById("past").focus()')
        press(browser, "Tab")
        assert browser.value("document.activeElement.id") == "truth"
        press(browser, " ")
        assert not browser.value("viewer.playing")
        assert not browser.value('document.getElementById("truth").checked')

    def test_everything_has_its_place_in_a_small_window(self, browser):
        slide(browser, 7.0)
        browser.value("viewer.change({ selected: viewer.present[0].index })")
        browser.resize(800, 600)
        browser.wait_for("document.documentElement.clientWidth === 800 && !viewer.dirty")
        rows = "new Set([...document.querySelectorAll('#switches > *')].map((e) => Math.round("
        rows += "e.getBoundingClientRect().y + e.getBoundingClientRect().height / 2))).size"
        assert browser.value(rows) == 1
        inside = """["scores", "agent", "legend"].map((name) => {
          const own = document.getElementById(name).getBoundingClientRect();
          const all = document.querySelector("main").getBoundingClientRect();
          return own.top >= all.top && own.bottom <= all.bottom && own.right <= all.right;
        })"""
        assert browser.value(inside) == [True, True, True]
        browser.resize(800, 360)
        browser.wait_for("document.documentElement.clientHeight === 360 && !viewer.dirty")
        assert browser.value(inside) == [True, True, True]
        browser.resize(1280, 800)

    def test_it_fits_a_phone(self, browser):
        browser.resize(390, 780, mobile=True, scale=2)
        browser.wait_for("document.documentElement.clientWidth === 390")
        assert browser.value("document.documentElement.scrollWidth") <= 390
        assert browser.value('document.getElementById("view").clientHeight') > 350
        browser.resize(1280, 800)
