// Copyright 2026 the mtpgo_ros developers
// SPDX-License-Identifier: Apache-2.0
// Draws one instant. Lengths are metres; `px` is the size of a pixel in metres.

const PAST_S = 3;
// Colours that differ in lightness as well, for those who do not see red and green apart.
const THEMES = {
  light: {
    ground: "#f4f5f3", road: "rgba(120,130,140,.10)", lane: "#b9bfc5", text: "#1c2126",
    truth: "#15191d", before: "#a00000", fallback: "#7b858e", halo: "#f4f5f3",
    classes: {
      car: "#1f6fd1", van: "#56b4e9", truck: "#d9730d", bus: "#4b1f82", trailer: "#6b3a12",
      motorcycle: "#00695c", bicycle: "#8cc81e", pedestrian: "#e0246b", animal: "#b8a04a",
      unknown: "#2f353b",
    },
  },
  dark: {
    ground: "#11161c", road: "rgba(150,165,180,.10)", lane: "#4a5561", text: "#e8ecef",
    truth: "#f2f4f5", before: "#ff4d4d", fallback: "#6f7b86", halo: "#11161c",
    classes: {
      car: "#5aa9ff", van: "#9be3ff", truck: "#ff9838", bus: "#a06bff", trailer: "#c07a3a",
      motorcycle: "#1fa893", bicycle: "#b6e34d", pedestrian: "#ff6aa0", animal: "#e3cf8a",
      unknown: "#d5dbe0",
    },
  },
};

class Painter {
  constructor(canvas, scene, timeline, camera) {
    Object.assign(this, { canvas, scene, timeline, camera });
    this.context = canvas.getContext("2d");
    this.theme = THEMES.light;
    this.road = this.makeRoad();
    this.lanes = new Path2D();
    for (const lane of scene.lanes) {
      lane.x.forEach((x, i) => this.lanes[i ? "lineTo" : "moveTo"](x, lane.y[i]));
    }
  }

  // Without lanes, the ways of all road users show where the road is.
  makeRoad() {
    const path = new Path2D();
    for (const track of this.scene.tracks) {
      let last = null;
      for (let i = 0; i < track.t.length; i++) {
        const jump = last !== null && track.t[i] - track.t[i - 1] > track.gap;
        const away = last === null ? 0 : Math.hypot(track.x[i] - track.x[last],
          track.y[i] - track.y[last]);
        if (last !== null && !jump && away < 3 && i < track.t.length - 1) continue;
        path[last === null || jump ? "moveTo" : "lineTo"](track.x[i], track.y[i]);
        last = i;
      }
    }
    return path;
  }

  draw(t, shown, selected) {
    const { context: g, camera, canvas, theme } = this;
    const ratio = window.devicePixelRatio || 1;
    const width = Math.round(camera.width * ratio), height = Math.round(camera.height * ratio);
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width; canvas.height = height;
    }
    g.setTransform(1, 0, 0, 1, 0, 0);
    g.globalAlpha = 1;
    g.fillStyle = theme.ground;
    g.fillRect(0, 0, width, height);
    camera.apply(g, ratio);
    this.px = 1 / camera.scale;
    g.lineCap = g.lineJoin = "round";
    this.drawGround();
    const present = this.timeline.present(t), prediction = this.timeline.predictionAt(t);
    if (shown.past) for (const one of present) this.drawPast(one, t);
    if (prediction) {
      for (const one of present) {
        const agent = prediction.agents.get(one.index);
        if (agent) this.drawModes(one, agent, t - prediction.t - prediction.delay, shown, selected);
      }
    }
    if (shown.truth) for (const one of present) this.drawTruth(one, t, one.index === selected);
    if (shown.before) this.drawBefore(present, t);
    for (const one of present) this.drawBody(one, one.index === selected);
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (shown.names || selected !== null) this.drawNames(present, shown.names, selected);
    this.drawScale();
    return present;
  }

  line(points, color, width, alpha, dash = []) {
    if (points.length < 2) return;
    const g = this.context;
    g.beginPath();
    points.forEach(([x, y], i) => g[i ? "lineTo" : "moveTo"](x, y));
    g.globalAlpha = alpha;
    g.strokeStyle = color;
    g.lineWidth = width * this.px;
    g.setLineDash(dash.map((d) => d * this.px));
    g.stroke();
    g.setLineDash([]);
  }

  drawGround() {
    const g = this.context;
    g.globalAlpha = 1;
    if (this.scene.lanes.length) {
      g.strokeStyle = this.theme.lane;
      g.lineWidth = 1.4 * this.px;
      g.stroke(this.lanes);
    } else {
      g.strokeStyle = this.theme.road;
      g.lineWidth = Math.max(2.6, 3 * this.px);
      g.stroke(this.road);
    }
  }

  color(track) { return this.theme.classes[track.kind] || this.theme.classes.unknown; }

  drawPast({ track, pose }, t) {
    const way = wayOf(track, t - PAST_S, t);
    way.push([pose.x, pose.y]);
    this.line(way, this.color(track), 1.6, 0.45);
  }

  // Each mode is a line and ellipses, the fainter the less likely it is and the farther ahead.
  drawModes({ index, track, pose }, agent, age, shown, selected) {
    const faint = selected !== null && selected !== index ? 0.35 : 1;
    const color = agent.source === 0 ? this.color(track) : this.theme.fallback;
    const strongest = agent.modes.length ? agent.modes[0].weight : 1;
    const times = this.scene.head.path_s;
    for (let m = agent.modes.length - 1; m >= 0; m--) {
      const mode = agent.modes[m], share = mode.weight / strongest;
      // The ellipses of other modes than the heaviest would hide each other in dense traffic.
      if (shown.ellipses && (m === 0 || selected === index)) {
        this.drawEllipses(mode, color, age, faint * (0.4 + 0.6 * share));
      }
      if (!shown.modes) continue;
      const points = [[pose.x, pose.y]];
      times.forEach((s, i) => { if (s > age) points.push([mode.x[i], mode.y[i]]); });
      const dash = agent.source === 0 ? [] : [5, 4];
      this.line(points, color, 1 + 1.4 * share, faint * (0.08 + 0.87 * share ** 1.5), dash);
      const [x, y] = points[points.length - 1];
      const g = this.context;
      g.beginPath();
      g.arc(x, y, (1.4 + 1.2 * share) * this.px, 0, 2 * Math.PI);
      g.fillStyle = color;
      g.fill();
    }
  }

  drawEllipses(mode, color, age, alpha) {
    const g = this.context;
    this.scene.head.ellipse_points.forEach((point, i) => {
      if (this.scene.head.path_s[point] <= age) return;
      g.beginPath();
      g.ellipse(mode.x[point], mode.y[point], mode.major[i], mode.minor[i], mode.angle[i], 0,
        2 * Math.PI);
      g.globalAlpha = 0.1 * alpha;
      g.fillStyle = color;
      g.fill();
      g.globalAlpha = 0.35 * alpha;
      g.strokeStyle = color;
      g.lineWidth = this.px;
      g.stroke();
    });
  }

  drawTruth({ track, pose }, t, chosen) {
    const way = [[pose.x, pose.y], ...wayOf(track, t + 1e-3, t + (this.timeline.horizon || 5))];
    this.line(way, this.theme.truth, chosen ? 1.8 : 1, chosen ? 0.95 : 0.5, [3, 3]);
  }

  // Where the prediction of one horizon ago saw the road users now.
  drawBefore(present, t) {
    const { last } = this.timeline.scoresAt(t);
    if (!last) return;
    this.timeline.keep(last);
    const g = this.context;
    for (const { index, pose } of present) {
      const agent = last.agents.get(index);
      if (!agent || !agent.modes.length) continue;
      const mode = agent.modes[0], end = mode.x.length - 1;
      const points = Array.from(mode.x, (x, i) => [x, mode.y[i]]);
      this.line(points, this.theme.before, 1.4, 0.8);
      this.line([points[end], [pose.x, pose.y]], this.theme.before, 1, 0.8, [1, 3]);
      g.globalAlpha = 1;
      g.fillStyle = this.theme.before;
      g.beginPath();
      g.arc(mode.x[end], mode.y[end], 3 * this.px, 0, 2 * Math.PI);
      g.fill();
    }
  }

  drawBody({ track, pose }, chosen) {
    const g = this.context, least = 3 * this.px;
    const length = Math.max(track.length, 1.6 * least), width = Math.max(track.width, least);
    g.save();
    g.translate(pose.x, pose.y);
    g.rotate(pose.yaw);
    g.globalAlpha = 1;
    g.beginPath();
    if (track.kind === "pedestrian") g.arc(0, 0, Math.max(0.35, least), 0, 2 * Math.PI);
    else g.roundRect(-length / 2, -width / 2, length, width, Math.min(0.4, width / 4));
    if (chosen || track.ego) {
      g.strokeStyle = this.theme.text;
      g.lineWidth = 6 * this.px;
      g.stroke();
    }
    g.fillStyle = this.color(track);
    g.fill();
    g.strokeStyle = this.theme.halo;
    g.lineWidth = this.px;
    g.stroke();
    if (track.kind !== "pedestrian" && width > 8 * this.px) {  // the front
      g.globalAlpha = 0.55;
      g.fillStyle = this.theme.halo;
      g.fillRect(length * 0.16, -width * 0.36, length * 0.13, width * 0.72);
    }
    g.restore();
  }

  drawNames(present, all, selected) {
    const g = this.context;
    g.globalAlpha = 1;
    g.font = "11px system-ui, sans-serif";
    g.textAlign = "left";
    g.textBaseline = "middle";
    g.lineWidth = 3;
    for (const { index, track, pose } of present) {
      if (!all && index !== selected) continue;
      const [x, y] = this.camera.toPixels(pose.x, pose.y);
      const text = track.id.length > 10 ? `${track.id.slice(0, 8)}…` : track.id;
      g.strokeStyle = this.theme.halo;
      g.fillStyle = this.theme.text;
      g.strokeText(text, x + 9, y - 11);
      g.fillText(text, x + 9, y - 11);
    }
  }

  drawScale() {
    const { context: g, camera } = this;
    const metres = [1, 2, 5, 10, 20, 50, 100, 200, 500].find((m) => m * camera.scale > 60) || 1000;
    const length = metres * camera.scale, x = camera.width - 16, y = camera.height - 16;
    g.globalAlpha = 1;
    g.strokeStyle = g.fillStyle = this.theme.text;
    g.lineWidth = 2;
    g.lineCap = "butt";
    g.beginPath();
    g.moveTo(x - length, y); g.lineTo(x, y);
    g.stroke();
    g.font = "11px system-ui, sans-serif";
    g.textAlign = "center";
    g.textBaseline = "bottom";
    g.fillText(`${metres} m`, x - length / 2, y - 3);
  }
}
