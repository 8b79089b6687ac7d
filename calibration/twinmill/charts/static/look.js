// SPDX-License-Identifier: Apache-2.0
// One look for all canvases. Colours of Okabe and Ito (2008), told apart by colour-blind readers.

export const MEASURED = "#3c3c3c";
export const PREDICTED = "#d55e00";
export const BEFORE = "#0072b2";
export const FLOOR = "#009e73";
export const MARK = "#cc79a7";
export const CURSOR = "#0072b2";
export const GRID = "#e9edef";
export const WORDS = "#5c6b73";
export const WHEELS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7"];
export const FONT = "12px system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";
export const SMALL = "11px system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";

/** Round distances between marks of an axis: about so many over the span. */
export function ticks(low, high, about) {
  const rough = (high - low) / about;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].map((k) => k * power).find((s) => s >= rough * 0.999);
  const found = [];
  for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) found.push(v);
  return { step, at: found };
}

/** A number with as many digits as its step needs. */
export function worded(value, step) {
  let digits = 0;
  while (digits < 6 && Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) > 1e-6) {
    digits += 1;
  }
  const words = value.toFixed(digits);
  return Number(words) === 0 ? (0).toFixed(digits) : words;
}

/** A canvas as large as its box; one that keeps what does not move, and one for what lies under that. */
export class Sheet {
  constructor(canvas) {
    this.canvas = canvas;
    this.still = document.createElement("canvas");
    this.under = document.createElement("canvas");
    this.width = 0;
    this.height = 0;
  }

  /** True where the size changed. */
  fit() {
    const box = this.canvas.getBoundingClientRect();
    const ratio = window.devicePixelRatio || 1;
    const [w, h] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
    if (!w || !h || (this.canvas.width === w && this.canvas.height === h)) return false;
    for (const canvas of [this.canvas, this.still, this.under]) {
      canvas.width = w;
      canvas.height = h;
      canvas.getContext("2d").setTransform(ratio, 0, 0, ratio, 0, 0);
    }
    [this.width, this.height] = [box.width, box.height];
    return true;
  }

  /** A kept one, cleared. */
  base(canvas = this.still) {
    const g = canvas.getContext("2d");
    g.clearRect(0, 0, this.width, this.height);
    return g;
  }

  /** The shown one, with what is kept on it. */
  top() {
    const g = this.base(this.canvas);
    this.copy(this.still, g);
    return g;
  }

  /** One of the canvases on another. */
  copy(canvas, g) {
    g.save();
    g.setTransform(1, 0, 0, 1, 0, 0);
    g.drawImage(canvas, 0, 0);
    g.restore();
  }
}
