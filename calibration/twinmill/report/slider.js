// SPDX-License-Identifier: Apache-2.0
// Draws PHASE into #phase: two axes as a map, a slider for each other.
(() => {
  const P = PHASE, box = document.getElementById("phase"), n = P.axes.length;
  const at = P.axes.map((axis) => Math.floor(axis.values.length / 2));
  let across = 0, up = n > 1 ? 1 : -1;
  const make = (parent, tag, set = {}) => parent.appendChild(Object.assign(document.createElement(tag), set));
  const svgNode = (parent, tag, set) => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const key in set) node.setAttribute(key, set[key]);
    return parent.appendChild(node);
  };
  const cellOf = (place) => {
    let index = 0;
    for (let k = n - 1; k >= 0; --k) index = index * P.axes[k].values.length + place[k];
    return index;
  };
  const order = (k) => P.axes[k].values.map((v, i) => i).sort((a, b) => P.axes[k].values[a] - P.axes[k].values[b]);
  const format = (value) => String(+value.toPrecision(4));

  const controls = make(box, "div"), picture = make(box, "div"), told = make(box, "p", { className: "note" });
  const describe = (place) => {
    const cell = cellOf(place);
    const where = P.axes.map((axis, k) => [axis, place[k]]).filter(([axis]) => axis.values.length > 1)
      .map(([axis, i]) => `${axis.label} ${format(axis.values[i])}`).join(", ");
    const what = P.classes.map(([name], k) => [name, P.counts[cell][k]]).filter(([, count]) => count > 0)
      .sort((a, b) => b[1] - a[1]).map(([name, count]) => `${name} ${count}`).join(", ");
    told.textContent = `${where}: ${what} of ${P.seeds}; '${P.goal}' ${P.hits[cell]}`;
  };
  const paintCell = (svg, place, x, y, width, height) => {
    const counts = P.counts[cellOf(place)], most = counts.indexOf(Math.max(...counts));
    const cell = svgNode(svg, "rect", { x, y, width, height, fill: P.classes[most][1],
      "fill-opacity": 0.15 + 0.85 * counts[most] / P.seeds, stroke: "#fff", "stroke-width": 0.5 });
    cell.addEventListener("pointerenter", () => describe(place));
    cell.addEventListener("click", () => describe(place));
  };
  const draw = () => {
    picture.textContent = "";
    const xs = order(across), ys = up < 0 ? [0] : order(up);
    const W = 460, H = up < 0 ? 60 : 320, left = 56, bottom = 40, w = W / xs.length, h = H / ys.length;
    const svg = svgNode(picture, "svg", { viewBox: `0 0 ${W + left + 8} ${H + bottom + 4}`, role: "img" });
    const write = (text, x, y, more) => svgNode(svg, "text", { x, y, "font-size": 11, "text-anchor": "middle", ...more })
      .textContent = text;
    const few = (count) => Math.ceil(count / 10);
    xs.forEach((i, column) => {
      ys.forEach((j, row) => {
        const place = [...at];
        place[across] = i;
        if (up >= 0) place[up] = j;
        paintCell(svg, place, left + column * w, H - (row + 1) * h, w, h);
      });
      if (column % few(xs.length) === 0) write(format(P.axes[across].values[i]), left + (column + 0.5) * w, H + 14);
    });
    write(P.axes[across].label, left + W / 2, H + 32);
    if (up < 0) return;
    ys.forEach((j, row) => {
      if (row % few(ys.length) === 0)
        write(format(P.axes[up].values[j]), left - 5, H - (row + 0.5) * h + 4, { "text-anchor": "end" });
    });
    write(P.axes[up].label, 12, H / 2, { transform: `rotate(-90 12 ${H / 2})` });
  };
  const chooser = (name, chosen, set) => {
    const select = make(make(controls, "label", { textContent: ` ${name} ` }), "select");
    P.axes.forEach((axis, k) => make(select, "option", { value: k, textContent: axis.label, selected: k === chosen }));
    select.onchange = () => { set(+select.value); rebuild(); };
  };
  const rebuild = () => {
    controls.textContent = "";
    if (n > 1) {
      chooser("along", across, (k) => { if (k === up) up = across; across = k; });
      chooser("up", up, (k) => { if (k === across) across = up; up = k; });
    }
    P.axes.forEach((axis, k) => {
      if (k === across || k === up || axis.values.length === 1) return;
      const line = make(make(controls, "div"), "label"), name = make(line, "span");
      const tell = () => { name.textContent = `${axis.label}: ${format(axis.values[order(k)[+slider.value]])} `; };
      const slider = make(line, "input", { type: "range", min: 0, max: axis.values.length - 1, step: 1 });
      slider.value = order(k).indexOf(at[k]);
      slider.oninput = () => { at[k] = order(k)[+slider.value]; tell(); draw(); describe(at); };
      tell();
    });
    draw();
    describe(at);
  };
  const legend = make(box, "p", { className: "note" });
  P.classes.filter((_, k) => P.counts.some((counts) => counts[k] > 0)).forEach(([name, color]) => {
    make(legend, "span", { textContent: "■ " }).style.color = color;
    make(legend, "span", { textContent: `${name}  ` });
  });
  rebuild();
})();
