// SPDX-License-Identifier: Apache-2.0
// The floor from above: measured and predicted paths, and robots where they are at the cursor.

import {
  BEFORE, FLOOR, GRID, MARK, MEASURED, PREDICTED, SMALL, Sheet, WORDS, ticks, worded,
} from "./look.js";
import { rowAt, valuesAt } from "./packed.js";

const TRAIL_S = 6;
const MARGIN_PX = 34;

export class Floor {
  constructor(canvas, stage) {
    this.sheet = new Sheet(canvas);
    this.stage = stage;
    this.robots = [];
    this.zoom = 1;
    this.centre = null;
    this._listen(canvas);
  }

  show(robots) {
    this.robots = robots;
    this.frame(...this.stage.span);
    this.zoom = 1;
    this.centre = null;
  }

  /** What is driven in a stretch of time fills the sheet. */
  frame(from_s, to_s) {
    this.bounds = this._bounds(from_s, to_s);
  }

  _bounds(from_s, to_s) {
    let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
    for (const { path } of this.robots) {
      const last = rowAt(path, to_s);
      for (let k = Math.max(rowAt(path, from_s), 0); k <= last; k++) {
        const x = path.data[4 * k + 1];
        const y = path.data[4 * k + 2];
        if (Number.isNaN(x)) continue;
        [x0, x1, y0, y1] = [Math.min(x0, x), Math.max(x1, x), Math.min(y0, y), Math.max(y1, y)];
      }
    }
    if (x0 > x1) return { x0: -1, x1: 1, y0: -1, y1: 1 };
    const room = 0.15;
    return { x0: x0 - room, x1: x1 + room, y0: y0 - room, y1: y1 + room };
  }

  _place() {
    const { x0, x1, y0, y1 } = this.bounds;
    const [w, h] = [this.sheet.width - 2 * MARGIN_PX, this.sheet.height - 2 * MARGIN_PX];
    this.scale = this.zoom * Math.min(w / (x1 - x0), h / (y1 - y0));
    const [cx, cy] = this.centre ?? [(x0 + x1) / 2, (y0 + y1) / 2];
    this.left = this.sheet.width / 2 - cx * this.scale;
    this.foot = this.sheet.height / 2 + cy * this.scale;
  }

  _x(x) {
    return this.left + this.scale * x;
  }

  _y(y) {
    return this.foot - this.scale * y;
  }

  // -- what stays -------------------------------------------------------------------------------

  drawStill() {
    this.sheet.fit();
    if (!this.bounds || !this.sheet.width) return;
    this._place();
    const g = this.sheet.base();
    this._grid(g);
    const picked = this.stage.robot;
    for (const robot of this.robots) {
      if (robot !== picked) this._line(g, robot.path, "#9aa5ab", 1, 0.35);
    }
    if (!picked) return;
    this._line(g, picked.path, MEASURED, 3, 0.4);
    this._marks(g, picked);
    this._restarts(g);
  }

  _grid(g) {
    g.font = SMALL;
    g.lineWidth = 1;
    const [w, h] = [this.sheet.width, this.sheet.height];
    const from = (0 - this.left) / this.scale;
    const across = ticks(from, from + w / this.scale, w / 90);
    g.strokeStyle = GRID;
    g.fillStyle = WORDS;
    g.textAlign = "center";
    g.textBaseline = "bottom";
    for (const x of across.at) {
      this._stroke(g, this._x(x), 0, this._x(x), h);
      if (this._x(x) > 40 && this._x(x) < w - 75) {
        g.fillText(worded(x, across.step), this._x(x), h - 3);
      }
    }
    g.textAlign = "left";
    g.textBaseline = "middle";
    const low = (this.foot - h) / this.scale;
    const up = ticks(low, low + h / this.scale, (w / 90) * (h / w));
    for (const y of up.at) {
      this._stroke(g, 0, this._y(y), w, this._y(y));
      if (this._y(y) > this._keyPx() && this._y(y) < h - 18) {
        g.fillText(worded(y, up.step), 4, this._y(y) - 7);
      }
    }
    g.textAlign = "right";
    g.textBaseline = "bottom";
    g.fillText("x, y in m", w - 5, h - 3);
  }

  /** What the key covers at the top, with half a line of numbers. */
  _keyPx() {
    const key = this.sheet.canvas.parentElement.querySelector(".key");
    return 14 + (key ? key.offsetTop + key.offsetHeight : 0);
  }

  _stroke(g, x0, y0, x1, y1) {
    g.beginPath();
    g.moveTo(Math.round(x0) + 0.5, Math.round(y0) + 0.5);
    g.lineTo(Math.round(x1) + 0.5, Math.round(y1) + 0.5);
    g.stroke();
  }

  _line(g, path, color, width, alpha, first = 0, last = path.rows - 1) {
    g.save();
    g.globalAlpha = alpha;
    g.strokeStyle = color;
    g.lineWidth = width;
    g.lineJoin = "round";
    g.beginPath();
    let broken = true;
    for (let k = first; k <= last; k++) {
      const x = path.data[4 * k + 1];
      if (Number.isNaN(x)) {
        broken = true;
        continue;
      }
      const [px, py] = [this._x(x), this._y(path.data[4 * k + 2])];
      if (broken) g.moveTo(px, py);
      else g.lineTo(px, py);
      broken = false;
    }
    g.stroke();
    g.restore();
  }

  /** Predictions that begin anew from the measured pose each time one has ended. */
  _restarts(g) {
    const prediction = this.stage.prediction;
    if (!prediction) return;
    const { starts } = prediction.arrays;
    const [a, b] = this.stage.span;
    let next = -Infinity;
    const kept = [];
    for (let k = 0; k < starts.rows; k++) {
      const t = starts.data[4 * k];
      if (t < next - 1e-4 || t < a || t > b) continue;
      next = t + this.stage.ahead_s;
      kept.push(k);
    }
    if (prediction.beside) this._lines(g, kept, prediction, prediction.arrays.ahead_beside, BEFORE, 1.2);
    this._lines(g, kept, prediction, prediction.arrays.ahead, PREDICTED, 1.4);
  }

  _lines(g, kept, prediction, ahead, color, width) {
    g.strokeStyle = color;
    g.lineWidth = width;
    g.lineJoin = "round";
    g.beginPath();
    for (const k of kept) this._ahead(g, k, prediction, ahead);
    g.stroke();
  }

  /** One prediction as a line on the current path. */
  _ahead(g, k, prediction, ahead) {
    const { starts } = prediction.arrays;
    const steps = Math.round(this.stage.ahead_s / prediction.step_s);
    g.moveTo(this._x(starts.data[4 * k + 1]), this._y(starts.data[4 * k + 2]));
    for (let i = 0; i < steps; i++) {
      const at = k * ahead.width + 2 * i;
      if (Number.isNaN(ahead.data[at])) break;
      g.lineTo(this._x(ahead.data[at]), this._y(ahead.data[at + 1]));
    }
  }

  _marks(g, robot) {
    for (const t of this.stage.marks) {
      const first = Math.max(rowAt(robot.path, t), 0);
      this._line(g, robot.path, MARK, 7, 0.55, first, rowAt(robot.path, t + 0.5));
    }
  }

  // -- what moves -------------------------------------------------------------------------------

  draw() {
    if (!this.bounds || !this.sheet.width) return;
    const g = this.sheet.top();
    const { t, robot: picked } = this.stage;
    for (const robot of this.robots) {
      const first = Math.max(rowAt(robot.path, t - TRAIL_S), 0);
      const color = robot === picked ? MEASURED : robot.color;
      this._line(g, robot.path, color, robot === picked ? 3 : 2, 0.8, first, rowAt(robot.path, t));
    }
    if (picked && this.stage.prediction) this._now(g);
    if (picked?.arrays?.seen.rows) this._sight(g, picked, t);
    const others = this.robots.filter((robot) => robot !== picked);
    for (const robot of others) this._robot(g, robot, t, false);
    if (picked) this._robot(g, picked, t, true); // above those that it touches
  }

  /** The prediction from the cursor on, with its band. */
  _now(g) {
    const prediction = this.stage.prediction;
    const { starts, ahead } = prediction.arrays;
    const k = rowAt(starts, this.stage.t + 1e-4);
    if (k < 0 || this.stage.t - starts.data[4 * k] > 0.5) return;
    const steps = Math.round(this.stage.ahead_s / prediction.step_s);
    const heading = starts.data[4 * k + 3];
    g.save();
    g.fillStyle = FLOOR;
    g.globalAlpha = 0.25;
    g.beginPath();
    for (let i = 0; i < steps; i++) {
      const at = k * ahead.width + 2 * i;
      if (Number.isNaN(ahead.data[at])) break;
      const [forward, left] = this.stage.bandAt((i + 1) * prediction.step_s);
      if (Number.isNaN(forward)) break;
      const [x, y] = [this._x(ahead.data[at]), this._y(ahead.data[at + 1])];
      g.moveTo(x, y);
      g.ellipse(x, y, forward * this.scale, left * this.scale, -heading, 0, 2 * Math.PI);
    }
    g.fill();
    g.globalAlpha = 1;
    g.lineCap = "round";
    if (prediction.beside) this._lines(g, [k], prediction, prediction.arrays.ahead_beside, BEFORE, 2.5);
    this._lines(g, [k], prediction, ahead, PREDICTED, 3);
    const last = this._lastOf(k, steps, ahead);
    if (last) {
      g.beginPath();
      g.arc(this._x(last[0]), this._y(last[1]), 4, 0, 2 * Math.PI);
      g.fillStyle = PREDICTED;
      g.fill();
      const path = this.stage.robot.path;
      const then = valuesAt(path, starts.data[4 * k] + last[2] * prediction.step_s);
      if (then) {
        g.lineWidth = 2;
        g.strokeStyle = MEASURED;
        g.beginPath();
        g.arc(this._x(then[1]), this._y(then[2]), 4, 0, 2 * Math.PI);
        g.stroke();
      }
    }
    g.restore();
  }

  _lastOf(k, steps, ahead) {
    for (let i = steps - 1; i >= 0; i--) {
      const at = k * ahead.width + 2 * i;
      if (!Number.isNaN(ahead.data[at])) return [ahead.data[at], ahead.data[at + 1], i + 1];
    }
    return null;
  }

  /** What the picked robot's camera covers, filled while it sees another robot. */
  _sight(g, robot, t) {
    const pose = valuesAt(robot.path, t);
    const told = robot.arrays.seen;
    const k = rowAt(told, t - (this.stage.prediction?.clock_s ?? 0));
    if (!pose || k < 0) return;
    const [, x, y, heading] = pose;
    const [half, middle] = [robot.cone.cone_rad / 2, heading + robot.cone.pan_rad];
    g.save();
    g.beginPath();
    g.moveTo(this._x(x), this._y(y));
    g.arc(
      this._x(x), this._y(y), robot.cone.range_m * this.scale, -middle - half, -middle + half,
    );
    g.closePath();
    g.globalAlpha = 0.12;
    g.fillStyle = FLOOR;
    if (told.data.subarray(k * told.width + 1, (k + 1) * told.width).some((bit) => bit)) g.fill();
    g.globalAlpha = 0.5;
    g.strokeStyle = FLOOR;
    g.stroke();
    g.restore();
  }

  _robot(g, robot, t, picked) {
    const pose = valuesAt(robot.path, t);
    if (!pose) return;
    const [, x, y, heading] = pose;
    const radius = Math.max(5, robot.radius_m * this.scale);
    g.save();
    g.translate(this._x(x), this._y(y));
    g.beginPath();
    g.arc(0, 0, radius, 0, 2 * Math.PI);
    g.fillStyle = picked ? "#ffffffd0" : "#ffffffb0";
    g.fill();
    g.lineWidth = picked ? 2.5 : 1.5;
    g.strokeStyle = picked ? BEFORE : robot.color;
    g.stroke();
    if (robot.heading) {
      g.beginPath();
      g.moveTo(0, 0);
      g.lineTo(radius * Math.cos(heading), -radius * Math.sin(heading));
      g.stroke();
    }
    if (this.robots.length > 1) {
      g.fillStyle = picked ? BEFORE : WORDS;
      g.font = SMALL;
      g.textAlign = "center";
      g.textBaseline = "bottom";
      g.lineWidth = 3;
      g.strokeStyle = "#fff"; // on what lies below
      g.strokeText(robot.name, 0, -radius - 2);
      g.fillText(robot.name, 0, -radius - 2);
    }
    g.restore();
  }

  // -- hands ------------------------------------------------------------------------------------

  _listen(canvas) {
    let from = null;
    canvas.addEventListener("pointerdown", (e) => {
      from = { x: e.offsetX, y: e.offsetY, moved: false, centre: this._middle() };
      canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener("pointermove", (e) => {
      if (!from) return;
      const [dx, dy] = [e.offsetX - from.x, e.offsetY - from.y];
      if (Math.hypot(dx, dy) > 4) from.moved = true;
      if (!from.moved) return;
      this.centre = [from.centre[0] - dx / this.scale, from.centre[1] + dy / this.scale];
      this.stage.redraw();
    });
    canvas.addEventListener("pointerup", (e) => {
      if (from && !from.moved) this._pick(e.offsetX, e.offsetY);
      from = null;
    });
    canvas.addEventListener("dblclick", () => {
      this.zoom = 1;
      this.centre = null;
      this.stage.redraw();
    });
    canvas.addEventListener("wheel", (e) => {
      if (!this.stage.zooms(e)) return;
      e.preventDefault();
      const factor = Math.exp(-e.deltaY / 500);
      const [x, y] = [(e.offsetX - this.left) / this.scale, (this.foot - e.offsetY) / this.scale];
      const [cx, cy] = this._middle();
      this.zoom = Math.min(Math.max(this.zoom * factor, 1), 60);
      this.centre = [x + (cx - x) / factor, y + (cy - y) / factor];
      if (this.zoom === 1) this.centre = null;
      this.stage.redraw();
    }, { passive: false });
  }

  _middle() {
    return [
      (this.sheet.width / 2 - this.left) / this.scale,
      (this.foot - this.sheet.height / 2) / this.scale,
    ];
  }

  /** A click on a robot picks it; one near the picked robot's path moves the cursor there. */
  _pick(px, py) {
    const { t } = this.stage;
    for (const robot of this.robots) {
      const pose = valuesAt(robot.path, t);
      if (!pose || robot === this.stage.robot) continue;
      const away = Math.hypot(this._x(pose[1]) - px, this._y(pose[2]) - py);
      if (away < Math.max(12, robot.radius_m * this.scale)) return this.stage.source.ask(robot.label);
    }
    const path = this.stage.robot?.path;
    if (!path) return;
    let [best, at] = [14, null];
    for (let k = 0; k < path.rows; k++) {
      const away = Math.hypot(
        this._x(path.data[4 * k + 1]) - px, this._y(path.data[4 * k + 2]) - py,
      );
      if (away < best) [best, at] = [away, path.data[4 * k]];
    }
    if (at !== null) this.stage.seek(at);
  }
}
