// SPDX-License-Identifier: Apache-2.0
// The stage: floor and series with one cursor, which moves here, without the server.

import { Floor } from "./floor.js";
import { Series, rowsOf } from "./series.js";

const SHORTEST_S = 0.5; // stretch that can be looked at
const SAVE_MS = 400;
const STEP_S = 0.1;
const WORST_S = 2.5; // of the worst moment that is played
const ZOOM = 1.25; // of a key

/**
 * Where data come from and wishes go to, `source`:
 * `log(place)`, `robot(index)`, `prediction(index)`: what packed.js unpacks, or null where there is
 * no answer: once there is one, the stage is told to ask again. `ask(label)`: another robot is
 * wanted. `leave()`: only the model itself. `remember(view)`: cursor, stretch and the like.
 * `keys`: more acts by key. `alone`: no page scrolls behind, and all keys are the stage's.
 */
export class Stage {
  constructor({ source, view }) {
    this.source = source;
    this.box = document.querySelector("#stage");
    this.t = view.t ?? 0;
    this.ahead_s = view.ahead_s ?? 2;
    this.rate = view.rate ?? 1;
    this.span = view.span ?? [0, 10];
    this._spanGiven = Boolean(view.span);
    this.end_s = 10;
    this.marks = [];
    this.playing = false;
    this._until = Infinity;
    this.frames = 0;
    this.robots = [];
    this.robot = null;
    this.prediction = null;
    this.band = null;
    this.floor = new Floor(document.querySelector("#floor"), this);
    this.series = new Series(document.querySelector("#series"), this);
    this._wire();
    new ResizeObserver(() => this.redraw()).observe(this.box);
    this._frame = this._frame.bind(this);
    requestAnimationFrame(this._frame);
  }

  // -- data -------------------------------------------------------------------------------------

  /** Paths of all robots of a log; nothing where they are shown. */
  async showLog(log) {
    if (log === this._log) return this._shown;
    this._log = log;
    this._shown = this._showLog(log);
    return this._shown;
  }

  async _showLog(log) {
    const found = await this.source.log(log);
    if (!found || log !== this._log) return;
    this.end_s = found.end_s;
    this.robots = found.robots.map((r, k) => ({ ...r, path: found.arrays[`path${k}`] }));
    if (!this._spanGiven) this.span = [0, this.end_s];
    this._spanGiven = false;
    this.t = Math.min(this.t, this.end_s);
    this.robot = null;
    this.prediction = null;
    this.marks = [];
    this.floor.show(this.robots);
    this._scrubber.max = this.end_s;
    this.redraw();
    document.body.dataset.paths = this.robots.length;
  }

  /** One robot's series; its prediction follows. */
  async pick(label, index) {
    if (!this.robots.some((r) => r.label === label)) return; // another log is shown by now
    this._picked = label;
    const found = await this.source.robot(index);
    if (!found || label !== this._picked) return; // another one was picked meanwhile
    const robot = this.robots.find((r) => r.label === label);
    if (!robot) return;
    Object.assign(robot, { ...found, index });
    this.robot = robot;
    this.band = found.arrays.band;
    this.marks = [];
    await this.predict();
  }

  /** The model changed. Of several changes at once the last is drawn. */
  predict() {
    this._stale = true;
    this._asking ??= this._ask();
    return this._asking;
  }

  /** Once all is drawn that was asked for. */
  async predicted() {
    await this._asking;
  }

  async _ask() {
    await null; // `_asking` is this before it ends
    while (this._stale && this.robot) {
      this._stale = false;
      const robot = this.robot;
      const found = await this.source.prediction(robot.index);
      if (found && robot === this.robot) this._predicted(found);
    }
    this._asking = null;
  }

  _predicted(found) {
    this.prediction = found;
    document.body.dataset.predicted = found.revision;
    document.body.dataset.beside = found.beside;
    document.querySelector("#beside").textContent = found.beside ? `${found.beside} ✕` : "";
    this._renew();
  }

  _renew() {
    if (this.robot?.arrays) {
      this.series.rows = rowsOf(
        this.robot, this.prediction, this.bandAt(this.ahead_s), this.ahead_s,
      );
    }
    this.redraw();
  }

  /** Half widths forward, left (m) and heading (rad) of the band, so many seconds ahead. */
  bandAt(ahead_s) {
    const { data, rows } = this.band;
    let before = [0, 0, 0, 0];
    for (let k = 0; k < rows; k++) {
      const row = data.subarray(4 * k, 4 * k + 4);
      if (row[0] >= ahead_s - 1e-6) {
        const share = (ahead_s - before[0]) / (row[0] - before[0]);
        return [1, 2, 3].map((i) => before[i] + share * (row[i] - before[i]));
      }
      before = row;
    }
    return [before[1], before[2], before[3]];
  }

  // -- time -------------------------------------------------------------------------------------

  seek(t) {
    this.t = Math.min(Math.max(t, 0), this.end_s);
    this._follow();
    this._moved = true;
    this._remember();
  }

  look(a, b) {
    const length = Math.min(Math.max(b - a, SHORTEST_S), this.end_s);
    const from = Math.min(Math.max(a, 0), this.end_s - length);
    this.span = [from, from + length];
    this.floor.frame(...this.span);
    this.redraw();
    this._remember();
  }

  /** The stretch goes with the cursor. */
  _follow() {
    const [a, b] = this.span;
    if (this.t >= a && this.t <= b) return;
    const from = Math.min(Math.max(this.t - 0.1 * (b - a), 0), this.end_s - (b - a));
    this.span = [from, from + b - a];
    this._still = true;
  }

  play(on = !this.playing) {
    this.playing = on;
    this._until = Infinity;
    if (on && this.t >= this.end_s - 0.01) this.seek(0);
    document.querySelector("#play").classList.toggle("playing", on);
    this._last = null;
    this._moved = true;
  }

  /** Moments to be marked; the worst is played from shortly before. */
  mark(times, worst, why) {
    this.marks = times;
    const words = document.querySelector("#marks");
    words.textContent = times.length ? `✕ ${why}, ${times.length} moments` : "";
    words.title = `Forget these marks: ${why}`;  // on a narrow screen the words are cut
    if (times.length) {
      this.seek(Math.max(worst, 0));
      this.play(true);
      this._until = worst + WORST_S;
    }
    if (times.length && this.span[1] - this.span[0] > 20) this.look(worst - 5, worst + 10);
    this.redraw();
  }

  setAhead(seconds) {
    this.ahead_s = seconds;
    for (const button of document.querySelectorAll("[data-ahead]")) {
      button.classList.toggle("on", Number(button.dataset.ahead) === seconds);
    }
    this._renew();
    this._remember();
  }

  // -- drawing ----------------------------------------------------------------------------------

  redraw() {
    this._still = true;
  }

  _frame(now) {
    requestAnimationFrame(this._frame);
    if (this.playing) {
      const passed = this._last ? (now - this._last) / 1000 : 0;
      this._last = now;
      this.seek(this.t + this.rate * passed);
      if (this.t >= Math.min(this.end_s, this._until)) this.play(false);
    }
    if (this._still) {
      this.floor.drawStill();
      this.series.drawStill();
    }
    if (!this._still && !this._moved) return;
    this._still = this._moved = false;
    this.floor.draw();
    this.series.draw();
    this._scrubber.value = this.t;
    this._clock.textContent = `${this.t.toFixed(2)} s`;
    this.frames += 1;
  }

  // -- hands ------------------------------------------------------------------------------------

  _wire() {
    this._scrubber = document.querySelector("#scrubber");
    this._clock = document.querySelector("#clock");
    this._scrubber.addEventListener("input", () => this.seek(Number(this._scrubber.value)));
    document.querySelector("#play").addEventListener("click", () => this.play());
    document.querySelector("#beside").addEventListener("click", () => this.source.leave());
    document.querySelector("#marks").addEventListener("click", () => this.mark([], 0, ""));
    for (const button of document.querySelectorAll("[data-ahead]")) {
      button.addEventListener("click", () => this.setAhead(Number(button.dataset.ahead)));
      button.classList.toggle("on", Number(button.dataset.ahead) === this.ahead_s);
    }
    const rates = [0.25, 0.5, 1, 2, 5, 10];
    const rate = document.querySelector("#rate");
    rate.textContent = `×${this.rate}`;
    rate.addEventListener("click", () => {
      this.rate = rates[(rates.indexOf(this.rate) + 1) % rates.length];
      rate.textContent = `×${this.rate}`;
      this._remember();
    });
    window.addEventListener("keydown", (e) => this._key(e));
    // After a click the keys are the cursor's again; one who tabs to a button presses it.
    window.addEventListener("click", (e) => {
      if (e.detail) e.target.closest("button, [role=button], [role=tab]")?.blur();
    });
    window.addEventListener("pagehide", () => this._tell());
  }

  _key(e) {
    if (!this.source.alone && !this.box.contains(e.target)) return;
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const typed = "input:not([type=range]), textarea, select, [contenteditable], .q-dialog";
    if (e.target.closest(typed)) return;
    const moves = {
      Home: () => this.seek(0),
      End: () => this.seek(this.end_s),
      ArrowRight: () => this.seek(this.t + (e.shiftKey ? 1 : STEP_S)),
      ArrowLeft: () => this.seek(this.t - (e.shiftKey ? 1 : STEP_S)),
    };
    const acts = {
      " ": () => this.play(),
      "+": () => this._zoom(1 / ZOOM),
      "-": () => this._zoom(ZOOM),
      0: () => this.look(0, this.end_s),
      ...this.source.keys,
    };
    // A focused knob, tab or list moves by the arrows; a focused button is pressed by the space.
    const taken = e.target.closest(".q-slider, .q-tab, [role=listbox], [role=combobox]");
    if (e.key === " " && e.target.closest("button, [role=button], .q-tab, [role=combobox]")) return;
    const act = acts[e.key] ?? (taken ? null : moves[e.key]);
    if (!act) return;
    e.preventDefault();
    act();
  }

  /** Whether a turn of the wheel is for the charts: within a page, only with Ctrl. */
  zooms(e) {
    return this.source.alone || e.ctrlKey || e.metaKey;
  }

  /** About the cursor. */
  _zoom(factor) {
    const [a, b] = this.span;
    this.look(this.t - (this.t - a) * factor, this.t + (b - this.t) * factor);
  }

  _remember() {
    this._due ??= setTimeout(() => this._tell(), SAVE_MS);
  }

  _tell() {
    clearTimeout(this._due);
    this._due = null;
    const { t, span, ahead_s, rate } = this;
    this.source.remember({ t, span, ahead_s, rate });
  }
}
