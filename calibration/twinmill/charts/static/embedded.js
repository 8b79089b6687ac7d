// SPDX-License-Identifier: Apache-2.0
// The stage in a report: its data stand in the page itself.

import { unpack } from "./packed.js";
import { Stage } from "./stage.js";

const BEFORE_S = 0.5; // the worst moment is shown from so long before it

class Page {
  alone = false;
  keys = {};

  constructor(ask) {
    this.ask = ask;
  }

  log(place) {
    return read(`log${place}`);
  }

  robot(index) {
    return read(`robot${index}`);
  }

  async prediction(index) {
    const found = await read(`prediction${index}`);
    return this.lonely ? { ...found, beside: "", arrays: without(found.arrays) } : found;
  }

  leave() {
    this.lonely = true;
    window.twinmill.predict();
  }

  remember() {}
}

function without(arrays) {
  return Object.fromEntries(Object.entries(arrays).filter(([name]) => !name.endsWith("_beside")));
}

/** What twinmill.charts.embedded.slim wrote. */
async function read(id) {
  const text = atob(document.getElementById(id).textContent);
  const deflated = Uint8Array.from(text, (c) => c.charCodeAt(0));
  const stream = new Blob([deflated]).stream().pipeThrough(new DecompressionStream("deflate"));
  const apart = new Uint8Array(await new Response(stream).arrayBuffer());
  const body = 4 + new DataView(apart.buffer).getUint32(0, true);
  const packed = apart.slice();
  const count = (apart.length - body) / 4;
  for (let k = 0; k < count; k++) {
    for (let i = 0; i < 4; i++) packed[body + 4 * k + i] = apart[body + i * count + k];
  }
  return unpack(packed.buffer);
}

export function start({ robots, first, view }) {
  const robot = document.querySelector("#robot");
  const where = document.querySelector("#where");
  const pick = async (index) => {
    robot.selectedIndex = index;
    const choices = robots[index].where.map(([, words]) => new Option(words));
    where.replaceChildren(new Option("Where it fails …", ""), ...choices);
    where.hidden = !choices.length;
    await stage.showLog(robots[index].log);
    await stage.pick(robots[index].label, index);
  };
  const stage = new Stage({
    source: new Page((label) => pick(robots.findIndex((r) => r.label === label))),
    view,
  });
  window.twinmill = stage;
  stage.box.tabIndex = 0;
  robot.addEventListener("change", () => pick(robot.selectedIndex));
  where.addEventListener("change", () => {
    const found = robots[robot.selectedIndex].where[where.selectedIndex - 1];
    if (!found) return stage.mark([], 0, "");
    const [name, , times, worst] = found;
    stage.mark(times, worst - BEFORE_S, name);
  });
  pick(first);
}
