// SPDX-License-Identifier: Apache-2.0
// The twin's swarms from above, side by side, each with a short trail; they play by themselves.

import { MEASURED, SMALL, Sheet, WHEELS, WORDS } from "/charts/look.js";

const TRAIL_S = 4;
const RATE = 5; // times real time
const MARGIN_PX = 18;

export class Swarm {
  constructor(found) {
    this.found = found;
    this.begin = performance.now();
    this._frame = this._frame.bind(this);
    requestAnimationFrame(this._frame);
  }

  /** Nothing more is drawn. */
  end() {
    this.found = null;
  }

  _frame(now) {
    if (!this.found) return;
    requestAnimationFrame(this._frame);
    const canvas = document.querySelector("#swarm"); // the page may not have it yet
    if (!canvas?.offsetParent) return;
    if (this.sheet?.canvas !== canvas) this.sheet = new Sheet(canvas);
    this.sheet.fit();
    const { labels, arrays, radius_m, step_s } = this.found;
    const steps = arrays.pose0.rows;
    const k = Math.floor((RATE * (now - this.begin)) / 1000 / step_s) % steps;
    const g = this.sheet.top();
    const width = this.sheet.width / labels.length;
    const bounds = this._bounds(labels.length);
    labels.forEach((label, i) => {
      g.save();
      g.beginPath();
      g.rect(i * width, 0, width, this.sheet.height);
      g.clip();
      this._one(g, arrays[`pose${i}`], k, bounds, i * width, width, radius_m, step_s);
      g.restore();
      g.font = SMALL;
      g.textAlign = "left";
      g.textBaseline = "top";
      g.fillStyle = WORDS;
      g.fillText(`${label}  ${(k * step_s).toFixed(0)} s`, i * width + 7, 5);
    });
  }

  /** Middle and reach of all robots in both, so that both have one scale. */
  _bounds(count) {
    if (this._known) return this._known;
    const [x, y] = [[Infinity, -Infinity], [Infinity, -Infinity]];
    for (let i = 0; i < count; i++) {
      const { data } = this.found.arrays[`pose${i}`];
      for (let k = 0; k < data.length; k += 3) {
        [x, y].forEach((span, axis) => {
          span[0] = Math.min(span[0], data[k + axis]);
          span[1] = Math.max(span[1], data[k + axis]);
        });
      }
    }
    const reach = Math.max(x[1] - x[0], y[1] - y[0]) / 2 + this.found.radius_m;
    this._known = { reach, x: (x[0] + x[1]) / 2, y: (y[0] + y[1]) / 2 };
    return this._known;
  }

  _one(g, pose, k, { reach, x: cx, y: cy }, left, width, radius_m, step_s) {
    const scale = (Math.min(width, this.sheet.height) - 2 * MARGIN_PX) / 2 / reach;
    const at = (row, n) => {
      const p = row * pose.width + 3 * n;
      return [
        left + width / 2 + (pose.data[p] - cx) * scale,
        this.sheet.height / 2 - (pose.data[p + 1] - cy) * scale,
        pose.data[p + 2],
      ];
    };
    for (let n = 0; n < pose.width / 3; n++) {
      g.strokeStyle = WHEELS[n % WHEELS.length];
      g.globalAlpha = 0.5;
      g.lineWidth = 1.2;
      g.beginPath();
      for (let row = Math.max(k - Math.round(TRAIL_S / step_s), 0); row <= k; row++) {
        const [x, y] = at(row, n);
        if (row) g.lineTo(x, y);
        else g.moveTo(x, y);
      }
      g.stroke();
      g.globalAlpha = 1;
      const [x, y, heading] = at(k, n);
      const radius = Math.max(3, radius_m * scale);
      g.strokeStyle = MEASURED;
      g.fillStyle = "#ffffffd0";
      g.beginPath();
      g.arc(x, y, radius, 0, 2 * Math.PI);
      g.fill();
      g.stroke();
      g.beginPath();
      g.moveTo(x, y);
      g.lineTo(x + radius * Math.cos(heading), y - radius * Math.sin(heading));
      g.stroke();
    }
  }
}
