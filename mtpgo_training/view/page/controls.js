// Copyright 2026 the mtpgo_ros developers
// SPDX-License-Identifier: Apache-2.0
// Buttons, keys, mouse and touch; the texts beside the picture.

const SWITCHES = ["modes", "ellipses", "past", "truth", "before", "names"];
const SPEEDS = [0.25, 0.5, 1, 2, 4];
const LEAST_FIT_SCALE = 3.2;  // pixels per metre at which boxes can be told from each other

const PRESSED_BY_SPACE = "button, input[type=checkbox]";

const byId = (id) => document.getElementById(id);

class Viewer {
  constructor(scene) {
    this.scene = scene;
    this.timeline = new Timeline(scene);
    this.camera = new Camera(byId("view"));
    this.painter = new Painter(byId("view"), scene, this.timeline, this.camera);
    this.t = 0; this.speed = 1; this.playing = false; this.followed = false;
    this.selected = null; this.pointers = new Map(); this.dirty = true;
    this.present = [];
    const slider = byId("slider");
    slider.max = Math.max(1, Math.round(this.timeline.end * 1000));
    slider.step = 50;
    this.setTheme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
    this.describe();
    this.connect();
    this.reset();
    requestAnimationFrame((now) => this.tick(now));
  }

  get narrow() { return document.documentElement.clientWidth <= 640; }

  // The picture

  tick(now) {
    const passed = Math.min(0.1, (now - (this.before || now)) / 1000);
    this.before = now;
    if (this.playing) {
      this.t += passed * this.speed;
      if (this.t >= this.timeline.end) { this.t = this.timeline.end; this.play(false); }
      this.dirty = true;
    }
    if (this.dirty) this.draw();
    requestAnimationFrame((next) => this.tick(next));
  }

  draw() {
    this.dirty = false;
    if (this.followed && this.selected !== null) {
      const pose = poseOf(this.scene.tracks[this.selected], this.t);
      if (pose) { this.camera.x = pose.x; this.camera.y = pose.y; }
    }
    const shown = Object.fromEntries(SWITCHES.map((name) => [name, byId(name).checked]));
    this.present = this.painter.draw(this.t, shown, this.selected);
    byId("slider").value = Math.round(this.t * 1000);
    const total = this.timeline.end.toFixed(1);
    byId("clock").textContent = `${this.t.toFixed(1)} / ${total} s`;
    this.writeScores();
    this.writeAgent();
    this.drawChart();
  }

  change(values) { Object.assign(this, values); this.dirty = true; }

  seek(t) { this.change({ t: Math.min(this.timeline.end, Math.max(0, t)) }); }

  play(playing) {
    if (playing && this.t >= this.timeline.end) this.t = 0;
    this.change({ playing });
    byId("play").textContent = playing ? "❚❚" : "▶";
  }

  setTheme(name) {
    document.documentElement.dataset.theme = this.themeName = name;
    this.painter.theme = THEMES[name];
    this.writeLegend();
    this.dirty = true;
  }

  points() {
    const out = [];
    for (const track of this.scene.tracks) {
      for (let i = 0; i < track.t.length; i += 5) out.push([track.x[i], track.y[i]]);
    }
    return pointsTogether(out);
  }

  reset() {
    const points = this.points();
    this.followed = false;
    this.camera.turnTo(points);
    this.camera.fit(points, LEAST_FIT_SCALE);
    this.change({});
  }

  // Texts

  describe() {
    const { head } = this.scene;
    byId("name").textContent = head.name;
    const facts = byId("facts");
    const date = new Date((head.start_s) * 1000);
    const stamp = head.start_s > 1e8 ? `${date.toISOString().slice(0, 19).replace("T", " ")} UTC`
      : `${head.start_s.toFixed(1)} s`;
    const from = head.offset_s ? `, from ${head.offset_s.toFixed(1)} s` : "";
    const parts = [["model", head.model || "not named"], ["frame", head.frame],
      ["start", stamp + from], ["road users", this.scene.tracks.length]];
    for (const [label, value] of parts) {
      const bold = document.createElement("b");
      bold.textContent = value;
      facts.append(facts.childNodes.length ? " · " : "", `${label} `, bold);
    }
  }

  writeLegend() {
    const kinds = [...new Set(this.scene.tracks.map((track) => track.kind))].sort();
    const theme = this.painter.theme;
    const items = kinds.map((kind) => [kind, theme.classes[kind]]);
    if (this.scene.predictions.some((p) => [...p.agents.values()].some((a) => a.source))) {
      items.push(["predicted at constant velocity", theme.fallback]);
    }
    byId("legend").replaceChildren(...items.map(([text, color]) => {
      const item = document.createElement("li"), mark = document.createElement("i");
      mark.style.background = color;
      item.append(mark, text);
      return item;
    }));
  }

  table(title, rows, note = "") {
    const parts = [];
    const heading = document.createElement("h2");
    heading.textContent = title;
    const table = document.createElement("table");
    for (const [label, ...values] of rows) {
      const row = table.insertRow();
      const cell = row.insertCell();
      cell.className = "label";
      cell.textContent = label;
      for (const value of values) row.insertCell().append(value);
    }
    parts.push(heading, table);
    if (note) {
      const text = document.createElement("p");
      text.className = "note";
      text.textContent = note;
      parts.push(text);
    }
    return parts;
  }

  writeScores() {
    const { now, all } = this.timeline.scoresAt(this.t);
    const h = this.timeline.horizon, metres = (sum, n) => (n ? `${(sum / n).toFixed(2)} m` : "–");
    const percent = (sum, n) => (n ? `${Math.round((100 * sum) / n)} %` : "–");
    if (!this.scene.predictions.length) {
      byId("scores").replaceChildren(...this.table("no predictions", []));
      return;
    }
    const rows = [
      ["", "now", "so far"],
      ["ADE", metres(now?.ade, now?.n), metres(all.ade, all.n)],
      [`error at ${h.toFixed(0)} s`, metres(now?.final, now?.m), metres(all.final, all.m)],
      [`in ${Math.round(100 * this.scene.head.level)} % ellipse`, percent(now?.inside, now?.k),
        percent(all.inside, all.k)],
      ["predictions", now?.n ? String(now.n) : "–", all.n ? String(all.n) : "–"],
    ];
    const note = `now: predictions made ${h.toFixed(0)} s ago, most probable mode`;
    byId("scores").replaceChildren(...this.table("how good it was", rows, note));
  }

  writeAgent() {
    const box = byId("agent");
    box.hidden = this.selected === null;
    byId("follow").setAttribute("aria-pressed", String(this.followed));
    if (box.hidden) return;
    const track = this.scene.tracks[this.selected], pose = poseOf(track, this.t);
    const agent = this.timeline.predictionAt(this.t)?.agents.get(this.selected);
    const then = this.timeline.scoresAt(this.t).last?.agents.get(this.selected);
    const metres = (v) => (v === undefined || Number.isNaN(v) ? "–" : `${v.toFixed(2)} m`);
    const rows = [["class", track.kind + (track.ego ? " (ego)" : "")],
      ["size", `${track.length.toFixed(1)} × ${track.width.toFixed(1)} m`]];
    if (pose) {
      rows.push(["speed", `${pose.speed.toFixed(1)} m/s, ${(3.6 * pose.speed).toFixed(0)} km/h`]);
    } else rows.push(["speed", "not present now"]);
    if (agent) {
      rows.push(["predicted by", this.scene.head.sources[agent.source] || "unknown"]);
      if (agent.source === 0) rows.push(["correction", this.scene.head.stages[agent.calibration] || "unknown"]);
      const most = this.narrow ? 3 : agent.modes.length;
      agent.modes.slice(0, most).forEach((mode, i) => {
        const bar = document.createElement("span"), value = document.createElement("span");
        bar.className = "bar";
        bar.style.width = `${(90 * mode.weight).toFixed(0)}px`;
        value.append(bar, `${(100 * mode.weight).toFixed(0)} %`);
        rows.push([i ? "" : "modes", value]);
      });
      if (agent.modes.length > most) rows.push(["", `and ${agent.modes.length - most} more`]);
    }
    rows.push([`ADE, ${this.timeline.horizon.toFixed(0)} s ago`, metres(then?.ade)],
      ["error now", metres(then?.final)]);
    box.replaceChildren(...this.table(`road user ${track.id}`, rows));
  }

  // Error at the horizon over time, with the present time.
  drawChart() {
    const canvas = byId("chart"), g = canvas.getContext("2d");
    const ratio = window.devicePixelRatio || 1;
    const w = canvas.clientWidth, h = canvas.clientHeight, theme = this.painter.theme;
    canvas.width = Math.round(w * ratio); canvas.height = Math.round(h * ratio);
    g.scale(ratio, ratio);
    const { end, horizon, errorPieces: pieces, largestError: top } = this.timeline;
    // Times lie above those of the slider, whose thumb is 16 pixels wide.
    const bar = byId("slider").getBoundingClientRect(), left = canvas.getBoundingClientRect().left;
    const [x0, x1] = [bar.left - left + 8, bar.right - left - 8];
    const x = (t) => x0 + (end ? (t / end) * (x1 - x0) : 0);
    this.chartRange = [x0, x1];
    const y = (v) => h - 3 - ((h - 8) * v) / top;
    g.strokeStyle = theme.classes.car;
    g.fillStyle = theme.classes.car;
    g.lineWidth = 1.5;
    for (const points of pieces) {
      g.globalAlpha = 1;
      g.beginPath();
      points.forEach(([t, v], i) => g[i ? "lineTo" : "moveTo"](x(t), y(v)));
      g.stroke();
      g.lineTo(x(points[points.length - 1][0]), h);
      g.lineTo(x(points[0][0]), h);
      g.globalAlpha = 0.12;
      g.fill();
    }
    g.globalAlpha = 1;
    g.fillStyle = theme.text;
    g.fillRect(x(this.t) - 0.75, 0, 1.5, h);
    g.font = "11px system-ui, sans-serif";
    g.globalAlpha = 0.75;
    g.textAlign = "right";
    const text = this.narrow ? `${top.toFixed(1)} m`
      : `error at ${horizon.toFixed(0)} s, up to ${top.toFixed(1)} m`;
    if (pieces.length) g.fillText(text, w - 2, 11);
  }

  // Input

  connect() {
    const on = (id, event, act) => byId(id).addEventListener(event, act);
    on("play", "click", () => this.play(!this.playing));
    on("slider", "input", (e) => this.seek(e.target.value / 1000));
    on("speed", "change", (e) => { this.speed = Number(e.target.value); });
    on("theme", "click", () => this.setTheme(this.themeName === "dark" ? "light" : "dark"));
    on("fit", "click", () => this.reset());
    on("turn", "click", () => this.turn());
    on("follow", "click", () => this.change({ followed: !this.followed }));
    for (const name of SWITCHES) on(name, "change", () => this.change({}));
    on("chart", "pointerdown", (e) => {
      const [x0, x1] = this.chartRange;
      this.seek(((e.offsetX - x0) / (x1 - x0)) * this.timeline.end);
    });
    const view = byId("view");
    view.addEventListener("wheel", (e) => {
      e.preventDefault();
      this.camera.zoom(Math.exp(-0.0015 * e.deltaY), e.offsetX, e.offsetY);
      this.change({});
    }, { passive: false });
    view.addEventListener("pointerdown", (e) => this.onDown(e));
    view.addEventListener("pointermove", (e) => this.onMove(e));
    for (const end of ["pointerup", "pointercancel"]) {
      view.addEventListener(end, (e) => this.onUp(e));
    }
    new ResizeObserver(() => this.change({})).observe(view);
    document.addEventListener("keydown", (e) => this.onKey(e));
    // What the mouse pressed keeps no keys: a space plays and pauses then, as everywhere.
    document.addEventListener("click", (e) => {
      if (e.detail && document.activeElement.matches(PRESSED_BY_SPACE)) {
        document.activeElement.blur();
      }
    });
  }

  turn() { this.camera.angle += Math.PI / 2; this.change({}); }

  onDown(e) {
    byId("view").setPointerCapture(e.pointerId);
    this.pointers.set(e.pointerId, [e.offsetX, e.offsetY]);
    this.moved = this.pointers.size > 1 ? Infinity : 0;
  }

  onMove(e) {
    const before = this.pointers.get(e.pointerId);
    if (!before) return;
    const now = [e.offsetX, e.offsetY];
    const others = [...this.pointers].filter(([id]) => id !== e.pointerId).map(([, at]) => at);
    const [du, dv] = [now[0] - before[0], now[1] - before[1]];
    this.moved += Math.abs(du) + Math.abs(dv);
    if (others.length) {
      const apart = (a) => Math.hypot(a[0] - others[0][0], a[1] - others[0][1]);
      const [px, py] = [(now[0] + others[0][0]) / 2, (now[1] + others[0][1]) / 2];
      this.camera.pan(du / 2, dv / 2);
      this.camera.zoom(apart(now) / Math.max(1, apart(before)), px, py);
    } else {
      this.camera.pan(du, dv);
      if (this.moved > 8) this.followed = false;
    }
    this.pointers.set(e.pointerId, now);
    this.change({});
  }

  onUp(e) {
    this.pointers.delete(e.pointerId);
    if (e.type === "pointerup" && this.moved < 8) this.selectAt(e.offsetX, e.offsetY);
  }

  selectAt(px, py) {
    let best = null, nearest = 22;
    for (const { index, track, pose } of this.present) {
      const [x, y] = this.camera.toPixels(pose.x, pose.y);
      const away = Math.hypot(x - px, y - py) - (track.length / 2) * this.camera.scale * 0.6;
      if (away < nearest) { nearest = away; best = index; }
    }
    this.change({ selected: best, followed: best !== null && this.followed });
  }

  onKey(e) {
    if (e.ctrlKey || e.metaKey || e.altKey || e.target.tagName === "SELECT") return;
    const step = this.scene.predictions.length > 1
      ? this.scene.predictions[1].t - this.scene.predictions[0].t : 0.1;
    const speed = (change) => {
      const i = SPEEDS.indexOf(this.speed) + change;
      this.speed = SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, i))];
      byId("speed").value = String(this.speed);
    };
    const toggle = (name) => { byId(name).checked = !byId(name).checked; this.change({}); };
    const keys = {
      " ": () => this.play(!this.playing),
      ArrowLeft: () => this.seek(this.t - (e.shiftKey ? 1 : step)),
      ArrowRight: () => this.seek(this.t + (e.shiftKey ? 1 : step)),
      Home: () => this.seek(0), End: () => this.seek(this.timeline.end),
      "+": () => speed(1), "-": () => speed(-1), 0: () => this.reset(), r: () => this.turn(),
      f: () => this.change({ followed: !this.followed }),
      d: () => this.setTheme(this.themeName === "dark" ? "light" : "dark"),
      m: () => toggle("modes"), e: () => toggle("ellipses"), p: () => toggle("past"),
      t: () => toggle("truth"), b: () => toggle("before"), i: () => toggle("names"),
      Escape: () => this.change({ selected: null, followed: false }),
    };
    const act = keys[e.key] || keys[e.key.toLowerCase()];
    if (!act || (e.key === " " && e.target.matches(PRESSED_BY_SPACE))) return;
    e.preventDefault();
    act();
  }
}

async function main() {
  if (typeof DecompressionStream === "undefined") {
    byId("problem").hidden = false;
    byId("problem").textContent = "This page needs a browser of 2023 or later.";
    return;
  }
  const scene = readScene(await inflate(byId("data").textContent));
  window.viewer = new Viewer(scene);
}

main();
