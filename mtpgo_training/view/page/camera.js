// Copyright 2026 the mtpgo_ros developers
// SPDX-License-Identifier: Apache-2.0
// From the frame of the data (m, y to the left) to pixels: centre, scale (pixels per metre), angle.

const LEAST_SCALE = 0.2, LARGEST_SCALE = 200;

const APART_M = 200, APART_RANGES = 10;

// The points that a view is made for. A road user that a tracker has far away would empty it.
function pointsTogether(points) {
  const apart = [0, 1].map((axis) => {
    const sorted = Float64Array.from(points, (point) => point[axis]).sort();
    const at = (share) => sorted[Math.floor(share * (sorted.length - 1))];
    return [at(0.5), APART_M + APART_RANGES * (at(0.75) - at(0.25))];
  });
  return points.filter((point) => apart.every(([middle, most], axis) => (
    Math.abs(point[axis] - middle) <= most)));
}

class Camera {
  constructor(canvas) {
    this.canvas = canvas;
    this.x = this.y = this.angle = 0;
    this.scale = 5;
  }

  get width() { return this.canvas.clientWidth; }
  get height() { return this.canvas.clientHeight; }

  // Draw in metres from here on.
  apply(context, ratio) {
    const c = Math.cos(this.angle) * this.scale, s = Math.sin(this.angle) * this.scale;
    context.setTransform(ratio * c, -ratio * s, -ratio * s, -ratio * c,
      ratio * (this.width / 2 - c * this.x + s * this.y),
      ratio * (this.height / 2 + s * this.x + c * this.y));
  }

  toPixels(x, y) {
    const c = Math.cos(this.angle) * this.scale, s = Math.sin(this.angle) * this.scale;
    const dx = x - this.x, dy = y - this.y;
    return [this.width / 2 + c * dx - s * dy, this.height / 2 - s * dx - c * dy];
  }

  toMetres(px, py) {
    const c = Math.cos(this.angle) / this.scale, s = Math.sin(this.angle) / this.scale;
    const u = px - this.width / 2, v = py - this.height / 2;
    return [this.x + c * u - s * v, this.y - s * u - c * v];
  }

  pan(du, dv) {
    const [x, y] = this.toMetres(this.width / 2 - du, this.height / 2 - dv);
    this.x = x; this.y = y;
  }

  // The point at the pixel stays where it is.
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toMetres(px, py);
    this.scale = Math.min(LARGEST_SCALE, Math.max(LEAST_SCALE, this.scale * factor));
    const [x2, y2] = this.toMetres(px, py);
    this.x += x - x2; this.y += y - y2;
  }

  // Turn so that the longest extent of the points lies along the longer side of the canvas.
  turnTo(points) {
    let mx = 0, my = 0, xx = 0, xy = 0, yy = 0;
    for (const [x, y] of points) { mx += x; my += y; }
    mx /= points.length || 1; my /= points.length || 1;
    for (const [x, y] of points) {
      xx += (x - mx) ** 2; xy += (x - mx) * (y - my); yy += (y - my) ** 2;
    }
    const along = 0.5 * Math.atan2(2 * xy, xx - yy);
    const wanted = this.width >= this.height ? 0 : Math.PI / 2;
    // Of the two ways, the one that turns the frame less.
    this.angle = Math.atan2(Math.sin(wanted - along), Math.cos(wanted - along));
    if (Math.abs(this.angle) > Math.PI / 2 + 1e-6) this.angle -= Math.sign(this.angle) * Math.PI;
    if (Math.abs(xx - yy) < 0.2 * (xx + yy) && Math.abs(xy) < 0.1 * (xx + yy)) this.angle = 0;
  }

  // Show the points, but no smaller than `leastScale`.
  fit(points, leastScale) {
    if (!points.length) return;
    const c = Math.cos(this.angle), s = Math.sin(this.angle);
    const us = points.map(([x, y]) => c * x - s * y), vs = points.map(([x, y]) => s * x + c * y);
    const range = (values) => {
      const sorted = Float64Array.from(values).sort();
      return [sorted[Math.floor(0.01 * (sorted.length - 1))],
        sorted[Math.ceil(0.99 * (sorted.length - 1))]];
    };
    const [[u0, u1], [v0, v1]] = [range(us), range(vs)];
    const u = (u0 + u1) / 2, v = (v0 + v1) / 2, room = 14;
    this.x = c * u + s * v; this.y = -s * u + c * v;
    this.scale = Math.max(leastScale,
      Math.min(this.width / (u1 - u0 + room), this.height / (v1 - v0 + room), 25));
  }
}
