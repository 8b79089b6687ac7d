// SPDX-License-Identifier: Apache-2.0
// The stage in the workbench: data come from the server, and wishes go to it.

import { unpack } from "/charts/packed.js";
import { Stage } from "/charts/stage.js";
import { keepFocus } from "./focus.js";
import { Swarm } from "./swarm.js";

class Server {
  alone = true;

  keys = {
    z: () => window.emitEvent("undo", {}),
    y: () => window.emitEvent("redo", {}),
  };

  constructor(token) {
    this.token = token;
  }

  log(place) {
    return this.get(`log?log=${place}`);
  }

  robot(index) {
    return this.get(`robot?index=${index}`);
  }

  /** What a hand moved meanwhile goes along. */
  prediction(index) {
    const { name = "", value = 0 } = this.moved ?? {};
    this.moved = null;
    return this.get(`prediction?index=${index}&name=${encodeURIComponent(name)}&value=${value}`);
  }

  ask(label) {
    window.emitEvent("pick", label);
  }

  leave() {
    window.emitEvent("leave", {});
  }

  remember(view) {
    navigator.sendBeacon(`data/view?token=${this.token}`, JSON.stringify(view));
  }

  /** Null where the server does not answer. */
  async get(what) {
    const answer = await fetch(`data/${what}&token=${this.token}`).catch(() => null);
    return answer?.ok ? unpack(await answer.arrayBuffer()) : null;
  }
}

class Workbench extends Stage {
  /** A hand turns a knob. */
  turn(name, value) {
    this.source.moved = { name, value };
    this.predict();
  }

  /** The server has predictions of that revision: what this page asked for itself is not asked again. */
  async renew(revision) {
    await this.predicted();
    if (!(this.prediction?.revision >= revision)) this.predict();
  }

  /** Why nothing can be opened; it stays when the server has gone. */
  fail(words) {
    const card = document.createElement("div");
    card.id = "failed";
    card.setAttribute("role", "alert");
    card.textContent = words;
    document.body.append(card);
  }

  /** What the twin's swarms did. */
  async showSwarm() {
    this.swarm = await this.source.get("swarm?");
    this._swarmView?.end();
    this._swarmView = this.swarm && new Swarm(this.swarm);
  }
}

const GONE = [
  "The workbench does not answer.",
  "Was it stopped? The same command goes on where you were, at another address: nothing is lost.",
];

export function start({ token, view, log }) {
  const words = document.querySelectorAll("#popup > span"); // NiceGUI shows it
  words.forEach((span, k) => (span.textContent = GONE[k]));
  keepFocus();
  window.twinmill = new Workbench({ source: new Server(token), view });
  window.twinmill.showLog(log);
}
