// Copyright 2026 the mtpgo_ros developers
// SPDX-License-Identifier: Apache-2.0
// What is where at a time, and how good predictions were until then. Times are in seconds.

const GAP_S = 0.6;    // a track is drawn between observations that are no farther apart,
const GAP_STEPS = 1.5;  // or than so many steps of the recording
const STALE_S = 1.0;  // a prediction is drawn for this long when no other follows

// Number of sorted values that are at most `value`.
function countUpTo(values, value, of = (v) => v) {
  let low = 0, high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (of(values[middle]) <= value) low = middle + 1; else high = middle;
  }
  return low;
}

function longestGap(frameS) {
  const steps = Array.from(frameS.subarray(1), (t, i) => t - frameS[i]).sort((a, b) => a - b);
  return Math.max(GAP_S, GAP_STEPS * (steps[steps.length >> 1] || 0));
}

function poseOf(track, t) {
  const next = countUpTo(track.t, t + 1e-4), i = next - 1;
  if (i < 0) return null;
  const gap = next < track.t.length ? track.t[next] - track.t[i] : Infinity;
  const past = t - track.t[i];
  if (gap > track.gap && past > 0.05) return null;
  const share = gap > track.gap ? 0 : Math.min(1, Math.max(0, past / gap));
  const mix = (v) => (share ? v[i] + (v[next] - v[i]) * share : v[i]);
  return { x: mix(track.x), y: mix(track.y), yaw: mix(track.yaw), speed: mix(track.speed) };
}

// Points of a track from `from` to `to`, as [x, y] pairs; a gap ends them.
function wayOf(track, from, to) {
  const out = [];
  for (let i = countUpTo(track.t, from - 1e-4); i < track.t.length && track.t[i] <= to; i++) {
    if (out.length && track.t[i] - track.t[i - 1] > track.gap) break;
    out.push([track.x[i], track.y[i]]);
  }
  return out;
}

class Timeline {
  constructor(scene) {
    this.scene = scene;
    this.end = scene.frameS.length ? scene.frameS[scene.frameS.length - 1] : 0;
    this.horizon = scene.head.horizon_s;
    this.kept = [];
    // Sums of errors and of hits of the ellipse, and the numbers of predictions that have them.
    this.sums = [{ ade: 0, final: 0, inside: 0, n: 0, m: 0, k: 0 }];
    this.means = scene.predictions.map((prediction) => {
      const before = this.sums[this.sums.length - 1];
      const sum = { ade: 0, final: 0, inside: 0, n: 0, m: 0, k: 0 };
      for (const agent of prediction.agents.values()) {
        if (!Number.isNaN(agent.ade)) { sum.ade += agent.ade; sum.n++; }
        if (!Number.isNaN(agent.final)) { sum.final += agent.final; sum.m++; }
        if (!Number.isNaN(agent.inside)) { sum.inside += agent.inside; sum.k++; }
      }
      const total = {};
      for (const key in sum) total[key] = before[key] + sum[key];
      this.sums.push(total);
      return sum;
    });
    // Mean error at the horizon, by the time at which it was known: [s, m] each.
    this.errors = [];
    scene.predictions.forEach((p, k) => {
      const { final, m } = this.means[k], known = p.t + this.horizon;
      if (m && known <= this.end + 1e-3) this.errors.push([known, final / m]);
    });
    // Pieces of that curve: none leads over a time without predictions.
    this.errorPieces = [];
    this.errors.forEach((point, i) => {
      if (!i || point[0] - this.errors[i - 1][0] > STALE_S) this.errorPieces.push([]);
      this.errorPieces[this.errorPieces.length - 1].push(point);
    });
    this.largestError = Math.max(1, ...this.errors.map(([, error]) => error));
  }

  predictionAt(t) {
    const k = countUpTo(this.scene.predictions, t + 1e-4, (p) => p.t) - 1;
    const found = k >= 0 && t - this.scene.predictions[k].t < STALE_S;
    return found ? this.keep(this.scene.predictions[k]) : null;
  }

  // Forget decoded modes but those of the last few predictions that were drawn.
  keep(prediction) {
    if (!this.kept.includes(prediction)) this.kept.push(prediction);
    if (this.kept.length > 8) {
      for (const agent of this.kept.shift().agents.values()) agent.decoded = null;
    }
    return prediction;
  }

  // Predictions whose whole horizon has passed, and the last of them if it just has.
  scoresAt(t) {
    const passed = countUpTo(this.scene.predictions, t - this.horizon + 1e-4, (p) => p.t);
    const last = passed ? this.scene.predictions[passed - 1] : null;
    const recent = last && t - this.horizon - last.t < STALE_S ? this.means[passed - 1] : null;
    return { last: recent ? last : null, now: recent, all: this.sums[passed] };
  }

  present(t) {
    const found = [];
    this.scene.tracks.forEach((track, index) => {
      const pose = poseOf(track, t);
      if (pose) found.push({ index, track, pose });
    });
    return found;
  }
}
