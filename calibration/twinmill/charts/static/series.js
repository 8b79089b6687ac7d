// SPDX-License-Identifier: Apache-2.0
// Speeds, commands and errors over one time axis, with the cursor that all views share.

import {
  BEFORE, CURSOR, FLOOR, GRID, MARK, MEASURED, PREDICTED, SMALL, Sheet, WHEELS, WORDS, ticks, worded,
} from "./look.js";
import { rowAt } from "./packed.js";

const LEFT_PX = 46;
const RIGHT_PX = 16;
const FOOT_PX = 18;
const HEAD_PX = 17;
const DEGREES = 180 / Math.PI;
const LOST_S = 0.6; // without a value a line is broken
const GRAINS = 5; // to a power of ten: ends of axes
const SHIFT_S = 0.005; // of a clock, that is seen

/** Rows of a robot: each a quantity with its lines (array, column, factor). */
export function rowsOf(robot, prediction, band, ahead_s) {
  const { speed, commands } = robot.arrays;
  const speeds = (column, factor) => {
    const lines = [{ of: speed, column, factor, color: MEASURED, width: 2.2, alpha: 0.5, name: "measured" }];
    if (prediction?.beside) {
      const of = prediction.arrays.predicted_speed_beside;
      lines.push({ of, column, factor, color: BEFORE, width: 1, alpha: 0.9, name: prediction.beside, ofModel: true });
    }
    if (prediction) {
      const of = prediction.arrays.predicted_speed;
      lines.push({ of, column, factor, color: PREDICTED, width: 1, alpha: 1, name: "predicted", ofModel: true });
    }
    return lines;
  };
  const names = robot.command_names;
  const rows = [
    { title: "forward", unit: "m/s", least: 0.1, lines: speeds(1, 1) },
    { title: "left", unit: "m/s", least: 0.1, lines: speeds(2, 1) },
    { title: "turn", unit: "°/s", least: 10, lines: speeds(3, DEGREES) },
    {
      title: "commands",
      unit: robot.command_unit,
      least: 0.1,
      lines: names.map((name, k) => (
        { of: commands, column: k + 1, factor: 1, color: WHEELS[k], width: 1.5, alpha: 0.85, name, held: true, shift: prediction?.clock_s ?? 0 }
      )),
    },
  ];
  if (robot.arrays.seen.rows) {
    const line = { column: 1, factor: 1, width: 1.5, shift: prediction?.clock_s ?? 0 };
    const { seen } = robot.arrays;
    const lines = Array.from({ length: seen.width - 1 }, (_, k) => ({
      ...line, of: seen, column: k + 1, color: k ? WHEELS[k] : MEASURED, alpha: 0.6,
      name: k ? `bit ${k + 1}` : "bit", held: true,
    }));
    const of = prediction?.arrays.expected;
    const named = { color: PREDICTED, alpha: 1, name: "its chance by the model", ofModel: true };
    if (of) lines.push({ ...line, ...named, of });
    rows.push({ title: "camera", unit: "1: sees another robot", least: 1, from: 0, lines });
  }
  if (prediction) {
    const far = ahead_s > 1 ? 3 : 1;
    const of = prediction.arrays.errors;
    const [forward, left, heading] = band;
    const errors = (column, factor) => {
      const line = { column, factor, alpha: 1, width: 1, ofModel: true };
      const lines = [{ ...line, of, color: PREDICTED, name: "error" }];
      const beside = prediction.arrays.errors_beside;
      if (beside) lines.unshift({ ...line, of: beside, color: BEFORE, name: prediction.beside });
      return lines;
    };
    rows.push({
      title: `position error, ${ahead_s} s ahead`, unit: "mm", least: 1,
      lines: errors(far, 1000),
      limits: [1000 * Math.hypot(forward, left)], from: 0,
    });
    rows.push({
      title: `heading error, ${ahead_s} s ahead`, unit: "°", least: 0.5,
      lines: errors(far + 1, DEGREES),
      limits: [heading * DEGREES, -heading * DEGREES],
    });
  }
  return rows;
}

/** Draws a line of many points; of those within one pixel of the axis only the lowest and highest. */
class Pen {
  constructor(g) {
    this.g = g;
    this.x = null;
  }

  begin(x, y) {
    this.end();
    this.g.moveTo(x, y);
    this._hold(x, y);
  }

  add(x, y) {
    if (x - this.x >= 1 || x < this.x) {
      this.end();
      this.g.lineTo(x, y);
      this._hold(x, y);
    } else {
      this.low = Math.min(this.low, y);
      this.high = Math.max(this.high, y);
      this.last = y;
    }
  }

  /** What is held back of the pixel. */
  end() {
    if (this.low === this.high) return;
    for (const y of [this.low, this.high, this.last]) this.g.lineTo(this.x, y);
    this.low = this.high;
  }

  _hold(x, y) {
    [this.x, this.low, this.high, this.last] = [x, y, y, y];
  }
}

export class Series {
  constructor(canvas, stage) {
    this.sheet = new Sheet(canvas);
    this.stage = stage;
    this.rows = [];
    this._drawn = [];
    this._words_px = []; // where values stand beside a row's title
    this._listen(canvas);
  }

  x(t) {
    const [a, b] = this.stage.span;
    return LEFT_PX + ((t - a) / (b - a)) * (this.sheet.width - LEFT_PX - RIGHT_PX);
  }

  t(x) {
    const [a, b] = this.stage.span;
    return a + ((x - LEFT_PX) / (this.sheet.width - LEFT_PX - RIGHT_PX)) * (b - a);
  }

  // -- what stays -------------------------------------------------------------------------------

  drawStill() {
    if (this.sheet.fit()) this._drawn = [];
    if (!this.sheet.width) return;
    const height = (this.sheet.height - FOOT_PX) / Math.max(this.rows.length, 1);
    this.rows.forEach((row, i) => {
      row.top = i * height + HEAD_PX;
      row.foot = (i + 1) * height - 5;
      this._scale(row);
    });
    this._drawMeasured();
    const g = this.sheet.base();
    this.sheet.copy(this.sheet.under, g);
    for (const row of this.rows) {
      this._within(g, row, () => this._lines(g, row, true));
    }
  }

  /** What no model changes is kept while a row's axes stay: a knob's turn draws the rest alone. */
  _drawMeasured() {
    const { span, marks, robot } = this.stage;
    const g = this.sheet.under.getContext("2d");
    this.rows.forEach((row, i) => {
      const shift = Math.round((row.lines[0]?.shift ?? 0) / SHIFT_S);
      const { title, top, foot, low, high } = row;
      const drawn = [...span, marks, robot, shift, title, top, foot, low, high];
      if (this._drawn[i]?.every((v, k) => v === drawn[k])) return;
      this._drawn[i] = drawn;
      g.clearRect(0, top - HEAD_PX, this.sheet.width, foot - top + HEAD_PX + 5);
      this._words_px[i] = this._frame(g, row);
      this._within(g, row, () => {
        this._marks(g, row);
        this._limits(g, row);
        this._lines(g, row, false);
      });
    });
    this._times(g);
  }

  /** Draws nothing outside a row. */
  _within(g, row, draw) {
    g.save();
    g.beginPath();
    g.rect(LEFT_PX, row.top - 1, this.sheet.width - LEFT_PX - RIGHT_PX, row.foot - row.top + 2);
    g.clip();
    draw();
    g.restore();
  }

  _lines(g, row, ofModel) {
    for (const line of row.lines) {
      if (Boolean(line.ofModel) === ofModel) this._line(g, row, line);
    }
  }

  /** From what is seen, with a little room; a few wild values do not flatten the rest. */
  _scale(row) {
    const [a, b] = this.stage.span;
    const found = [];
    for (const { of, column, factor, shift = 0 } of row.lines) {
      const first = Math.max(rowAt(of, a - shift), 0);
      const last = rowAt(of, b - shift);
      const every = Math.max(1, Math.floor((last - first) / 2000));
      for (let k = first; k <= last; k += every) {
        const v = of.data[k * of.width + column] * factor;
        if (!Number.isNaN(v)) found.push(v);
      }
    }
    const seen = Float64Array.from(found).sort();
    let low = seen[Math.floor(0.002 * seen.length)] ?? 0;
    let high = seen[Math.ceil(0.998 * seen.length) - 1] ?? 1;
    for (const limit of row.limits ?? []) {
      if (Number.isNaN(limit)) continue;
      low = Math.min(low, limit);
      high = Math.max(high, limit);
    }
    if (row.from !== undefined) low = row.from;
    const lacking = row.least - (high - low);
    if (lacking > 0) {
      high += lacking / 2;
      low -= row.from === undefined ? lacking / 2 : 0;
    }
    const room = 0.06 * (high - low);
    const grain = 10 ** Math.floor(Math.log10(high - low)) / GRAINS; // small changes move no axis
    row.high = Math.ceil((high + room) / grain) * grain;
    row.low = row.from === undefined ? Math.floor((low - room) / grain) * grain : low;
  }

  _y(row, v) {
    return row.foot - ((v - row.low) / (row.high - row.low)) * (row.foot - row.top);
  }

  _frame(g, row) {
    const marks = ticks(row.low, row.high, Math.max(4, (row.foot - row.top) / 24));
    g.font = SMALL;
    g.lineWidth = 1;
    g.textAlign = "right";
    g.textBaseline = "middle";
    for (const v of marks.at) {
      const y = Math.round(this._y(row, v)) + 0.5;
      g.strokeStyle = Math.abs(v) < 1e-9 ? "#c3cdd2" : GRID;
      g.beginPath();
      g.moveTo(LEFT_PX, y);
      g.lineTo(this.sheet.width - RIGHT_PX, y);
      g.stroke();
      g.fillStyle = WORDS;
      g.fillText(worded(v, marks.step), LEFT_PX - 5, y);
    }
    g.textAlign = "left";
    g.textBaseline = "bottom";
    g.fillStyle = "#26343b";
    g.font = `600 ${SMALL}`;
    g.fillText(row.title, LEFT_PX, row.top - 3);
    const wide = g.measureText(row.title).width;
    g.font = SMALL;
    g.fillStyle = WORDS;
    g.fillText(row.unit, LEFT_PX + wide + 6, row.top - 3);
    return LEFT_PX + wide + g.measureText(row.unit).width + 20;
  }

  _times(g) {
    const [a, b] = this.stage.span;
    g.clearRect(0, this.sheet.height - FOOT_PX, this.sheet.width, FOOT_PX);
    const marks = ticks(a, b, this.sheet.width / 80);
    g.font = SMALL;
    g.fillStyle = WORDS;
    g.textBaseline = "bottom";
    g.textAlign = "center";
    for (const t of marks.at) g.fillText(`${worded(t, marks.step)} s`, this.x(t), this.sheet.height - 2);
  }

  _marks(g, row) {
    g.fillStyle = MARK;
    g.globalAlpha = 0.3;
    for (const t of this.stage.marks) {
      g.fillRect(this.x(t), row.top, Math.max(this.x(t + 0.5) - this.x(t), 1.5), row.foot - row.top);
    }
    g.globalAlpha = 1;
  }

  /** What 95 % of the errors of a right model keep to. */
  _limits(g, row) {
    const limits = (row.limits ?? []).filter((v) => !Number.isNaN(v));
    if (!limits.length) return;
    const low = limits.length > 1 ? Math.min(...limits) : row.low;
    const [y0, y1] = [this._y(row, Math.max(...limits)), this._y(row, low)];
    g.fillStyle = FLOOR;
    g.globalAlpha = 0.16;
    g.fillRect(LEFT_PX, y0, this.sheet.width, y1 - y0);
    g.globalAlpha = 1;
  }

  _line(g, row, { of, column, factor, color, width, alpha, held, shift = 0 }) {
    const [a, b] = this.stage.span;
    const first = Math.max(rowAt(of, a - shift) - 1, 0);
    const last = Math.min(rowAt(of, b - shift) + 1, of.rows - 1);
    g.globalAlpha = alpha;
    g.strokeStyle = color;
    g.lineWidth = width;
    g.lineJoin = "bevel";
    g.beginPath();
    let broken = true;
    let before = 0;
    let since = -Infinity;
    const pen = new Pen(g);
    const [x0, perSecond] = [this.x(shift), this.x(1) - this.x(0)];
    const [y0, perUnit] = [this._y(row, 0), this._y(row, factor) - this._y(row, 0)];
    for (let k = first; k <= last; k++) {
      const t = of.data[k * of.width];
      const v = of.data[k * of.width + column];
      if (Number.isNaN(v)) {
        broken = true;
        continue;
      }
      if (!held && t - since > LOST_S) broken = true;
      since = t;
      const x = x0 + perSecond * t;
      const y = y0 + perUnit * v;
      if (broken) pen.begin(x, y);
      else {
        if (held) pen.add(x, before);
        pen.add(x, y);
      }
      before = y;
      broken = false;
    }
    pen.end();
    g.stroke();
    g.globalAlpha = 1;
  }

  // -- what moves -------------------------------------------------------------------------------

  draw() {
    if (!this.sheet.width) return;
    const g = this.sheet.top();
    const { t } = this.stage;
    const x = this.x(t);
    if (x >= LEFT_PX && x <= this.sheet.width - RIGHT_PX) {
      const ahead = Math.min(this.x(t + this.stage.ahead_s), this.sheet.width - RIGHT_PX);
      g.fillStyle = CURSOR;
      g.globalAlpha = 0.07;
      g.fillRect(x, 0, ahead - x, this.sheet.height - FOOT_PX);
      g.globalAlpha = 1;
      g.fillRect(x - 0.75, 0, 1.5, this.sheet.height - FOOT_PX);
    }
    g.font = SMALL;
    g.textBaseline = "bottom";
    this.rows.forEach((row, i) => this._read(g, row, this._words_px[i], t));
  }

  /** Values at the cursor, beside the row's title; without their names where these do not fit. */
  _read(g, row, from_px, t) {
    const told = row.lines.map(({ of, column, factor, color, name, held, shift = 0 }) => {
      const k = rowAt(of, t - shift);
      const lost = k < 0 || (!held && t - shift - of.data[k * of.width] > LOST_S);
      const v = lost ? NaN : of.data[k * of.width + column] * factor;
      return { name, color, value: Number.isNaN(v) ? "–" : worded(v, row.least / 10) };
    });
    const room = this.sheet.width - RIGHT_PX - from_px;
    const named = told.map(({ name, value }) => `${name} ${value}`);
    const wide = named.reduce((sum, words) => sum + g.measureText(words).width + 12, 0);
    let at = from_px;
    g.textAlign = "left";
    told.forEach(({ value, color }, i) => {
      const words = wide <= room ? named[i] : value;
      g.fillStyle = color;
      g.fillText(words, at, row.top - 3);
      at += g.measureText(words).width + 12;
    });
  }

  // -- hands ------------------------------------------------------------------------------------

  _listen(canvas) {
    let held = null;
    canvas.addEventListener("pointerdown", (e) => {
      held = { x: e.offsetX, span: [...this.stage.span], pan: e.shiftKey || e.button === 1 };
      canvas.setPointerCapture(e.pointerId);
      if (!held.pan) this.stage.seek(this.t(e.offsetX));
    });
    canvas.addEventListener("pointermove", (e) => {
      if (!held) return;
      if (!held.pan) return this.stage.seek(this.t(e.offsetX));
      const [a, b] = held.span;
      const dt = ((e.offsetX - held.x) / (this.sheet.width - LEFT_PX - RIGHT_PX)) * (b - a);
      this.stage.look(a - dt, b - dt);
    });
    canvas.addEventListener("pointerup", () => {
      held = null;
    });
    canvas.addEventListener("dblclick", () => this.stage.look(0, this.stage.end_s));
    canvas.addEventListener("wheel", (e) => {
      if (!this.stage.zooms(e)) return;
      e.preventDefault();
      const [a, b] = this.stage.span;
      if (Math.abs(e.deltaX) > Math.abs(e.deltaY)) {
        const dt = (e.deltaX / this.sheet.width) * (b - a);
        return this.stage.look(a + dt, b + dt);
      }
      const factor = Math.exp(e.deltaY / 400);
      const t = this.t(e.offsetX);
      this.stage.look(t - (t - a) * factor, t + (b - t) * factor);
    }, { passive: false });
  }
}
