"use strict";
// Copyright 2026 the mtpgo_ros developers
// SPDX-License-Identifier: Apache-2.0
// Reads the data that view/packed_scene.py packed; the layout is described there.

async function inflate(base64) {
  const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function readColumns(bytes) {
  const start = 4 + new DataView(bytes.buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(bytes.subarray(4, start)));
  const columns = {};
  let at = start;
  for (const [name, count] of head.columns) {
    const values = new Float64Array(count);
    for (let i = 0; i < count; i++) {
      let value = 0, scale = 1, byte;
      do {
        byte = bytes[at++];
        value += (byte & 127) * scale;
        scale *= 128;
      } while (byte & 128);
      values[i] = value % 2 ? -(value + 1) / 2 : value / 2;
    }
    columns[name] = values;
  }
  return { head, columns };
}

// Sums of differences, for a part of a column; of order 2 also of differences of differences.
function sums(values, begin, end, step = 1, order = 1) {
  const out = new Float32Array(end - begin);
  let value = 0, change = 0;
  for (let i = begin; i < end; i++) {
    change = order === 2 && i > begin ? change + values[i] : values[i];
    value += change;
    if (order === 2 && i === begin) change = 0;
    out[i - begin] = value * step;
  }
  return out;
}

function readScene(bytes) {
  const { head, columns: c } = readColumns(bytes);
  const s = head.steps;
  const frameS = sums(c.frame_ms, 0, c.frame_ms.length, 1e-3);
  const lanes = [];
  let at = 0;
  for (const points of c.lane_points) {
    lanes.push({
      x: sums(c.lane_x, at, at + points, s.position),
      y: sums(c.lane_y, at, at + points, s.position),
    });
    at += points;
  }
  const tracks = [], gap = longestGap(frameS);
  at = 0;
  c.track_rows.forEach((rows, i) => {
    const frames = sums(c.row_frame, at, at + rows);
    tracks.push({
      id: head.ids[i], kind: head.classes[c.track_class[i]] || "unknown", ego: head.ego === i, gap,
      length: c.track_length[i] * s.size, width: c.track_width[i] * s.size,
      t: Float32Array.from(frames, (f) => frameS[f]),
      x: sums(c.row_x, at, at + rows, s.position, 2),
      y: sums(c.row_y, at, at + rows, s.position, 2),
      yaw: sums(c.row_yaw, at, at + rows, s.yaw),
      speed: sums(c.row_speed, at, at + rows, s.speed),
    });
    at += rows;
  });
  return { head, lanes, tracks, frameS, predictions: readPredictions(head, c, s) };
}

// One agent's part of a prediction; its modes are decoded when they are drawn first.
class AgentPrediction {
  constructor(read, first, count, values) {
    Object.assign(this, values);
    this.read = read; this.first = first; this.count = count; this.decoded = null;
  }

  get modes() {
    if (!this.decoded) {
      this.decoded = [];
      for (let m = 0; m < this.count; m++) {
        this.decoded.push(this.read(this.first + m, this.decoded[0]));
      }
    }
    return this.decoded;
  }
}

function modeReader(head, c, s) {
  const points = head.path_s.length, ellipses = head.ellipse_points.length;
  const axis = (v) => s.ellipse_base * Math.exp(v / s.ellipse_steps);
  return (mode, heaviest) => {
    const path = (name) => sums(c[name], mode * points, (mode + 1) * points, s.position, 2);
    const part = (name) => sums(c[name], mode * ellipses, (mode + 1) * ellipses);
    const x = path("mode_x"), y = path("mode_y");
    if (heaviest) {
      for (let i = 0; i < points; i++) { x[i] += heaviest.x[i]; y[i] += heaviest.y[i]; }
    }
    return {
      weight: c.mode_weight[mode] / s.weights, x, y,
      major: part("ellipse_major").map(axis), minor: part("ellipse_minor").map(axis),
      angle: part("ellipse_angle").map((v) => v * Math.PI / s.ellipse_angles),
    };
  };
}

function readPredictions(head, c, s) {
  const stamps = sums(c.prediction_ms, 0, c.prediction_ms.length, 1e-3);
  const delays = sums(c.prediction_delay_ms, 0, c.prediction_ms.length, 1e-3);
  const known = (value, step) => (value > 0 ? (value - 1) * step : NaN);
  const read = modeReader(head, c, s);
  const out = [];
  let row = 0, mode = 0;
  for (let k = 0; k < stamps.length; k++) {
    const agents = new Map();
    let track = 0;
    for (let n = 0; n < c.agents[k]; n++, row++) {
      track += c.agent_track[row];
      agents.set(track, new AgentPrediction(read, mode, c.agent_modes[row], {
        source: c.agent_source[row], calibration: c.agent_calibration[row],
        ade: known(c.agent_ade[row], s.error), final: known(c.agent_final[row], s.error),
        inside: known(c.agent_inside[row], 1),
      }));
      mode += c.agent_modes[row];
    }
    out.push({ t: stamps[k], delay: delays[k], agents });
  }
  return out;
}
