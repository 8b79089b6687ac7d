// SPDX-License-Identifier: Apache-2.0
// Draws RUNS into #runs: panels with both runs over the time since their start, and one cursor.
(() => {
  const R = RUNS, box = document.getElementById("runs");
  const COLORS = ["#3c3c3c", "#d55e00"], LEFT = 52, RIGHT = 12, HEIGHT = 96, TITLE = 16, AXIS = 26;
  const make = (parent, tag, set = {}) => parent.appendChild(Object.assign(document.createElement(tag), set));
  const ends = R.panels.flatMap((p) => p.curves.flatMap((c) => [c.t[0], c.t[c.t.length - 1]])).filter(Number.isFinite);
  const whole = [Math.min(0, ...ends), Math.max(...ends)];
  let span = [...whole], cursor = Math.max(0, whole[0]);

  const legend = make(box, "p", { className: "note" });
  R.names.forEach((name, k) => {
    make(legend, "span", { textContent: "■ " }).style.color = COLORS[k];
    make(legend, "span", { textContent: `${name}  ` });
  });
  const now = make(legend, "b", { className: "now" });
  const canvas = make(box, "canvas");
  canvas.style.width = "100%";
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `${R.names[0]} and ${R.names[1]} over the time since their start`);

  // Place of the last sample at or before a time.
  const before = (t, at) => {
    let low = 0, high = t.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (t[middle] <= at) low = middle + 1; else high = middle;
    }
    return low - 1;
  };
  const valueAt = (curve, at) => {
    const k = before(curve.t, at);
    return k < 0 || at > curve.t[curve.t.length - 1] + 0.5 ? null : curve.v[k];
  };
  const limits = (panel) => {
    const seen = panel.curves.flatMap((c) => c.v).filter((v) => v !== null).map(Math.abs).sort((a, b) => a - b);
    return 1.15 * (seen[Math.floor(0.998 * (seen.length - 1))] || 1);  // a lost pose must not flatten the rest
  };
  const tops = R.panels.map(limits);
  const step = (length) => {
    const rough = length / 8, power = 10 ** Math.floor(Math.log10(rough));
    return [1, 2, 5, 10].map((k) => k * power).find((s) => s >= rough);
  };

  const draw = () => {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth;
    const height = R.panels.length * (HEIGHT + TITLE) + AXIS;
    Object.assign(canvas, { width: width * ratio, height: height * ratio });
    canvas.style.height = `${height}px`;
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.font = "11px system-ui, sans-serif";
    const x = (t) => LEFT + (t - span[0]) / (span[1] - span[0]) * (width - LEFT - RIGHT);
    const line = (x0, y0, x1, y1, color) => {
      pen.strokeStyle = color;
      pen.beginPath();
      pen.moveTo(x0, y0);
      pen.lineTo(x1, y1);
      pen.stroke();
    };
    R.panels.forEach((panel, row) => {
      const top = row * (HEIGHT + TITLE) + TITLE, middle = top + HEIGHT / 2;
      const y = (v) => middle - v / tops[row] * HEIGHT / 2;
      pen.save();
      pen.beginPath();
      pen.rect(LEFT, top, width - LEFT - RIGHT, HEIGHT);
      pen.clip();
      pen.fillStyle = "#fbe3d6";
      R.marks.forEach(([from, to]) => pen.fillRect(x(from), top, Math.max(1, x(to) - x(from)), HEIGHT));
      line(LEFT, middle, width - RIGHT, middle, "#e2e2e2");
      panel.curves.forEach((curve, k) => {
        pen.strokeStyle = COLORS[k];
        pen.lineWidth = 1.1;
        pen.beginPath();
        let down = false;
        const first = Math.max(0, before(curve.t, span[0]));
        for (let i = first; i < curve.t.length && curve.t[i] <= span[1] + 1; ++i) {
          if (curve.v[i] === null) { down = false; continue; }
          if (down) pen.lineTo(x(curve.t[i]), y(curve.v[i])); else pen.moveTo(x(curve.t[i]), y(curve.v[i]));
          down = true;
        }
        pen.stroke();
      });
      pen.setLineDash([4, 3]);
      R.since.forEach((t) => line(x(t), top, x(t), top + HEIGHT, "#b23a00"));
      pen.setLineDash([]);
      line(x(cursor), top, x(cursor), top + HEIGHT, "#0072b2");
      pen.restore();
      const told = panel.curves.map((c) => valueAt(c, cursor)).map((v) => v === null ? "–" : v.toFixed(v && Math.abs(v) < 1 ? 3 : 1));
      pen.fillStyle = "#222";
      pen.textAlign = "left";
      pen.fillText(`${panel.title} (${panel.unit})`, LEFT, top - 4);
      pen.textAlign = "right";
      [...told].reverse().forEach((text, k) => {
        pen.fillStyle = COLORS[told.length - 1 - k];
        pen.fillText(text, width - RIGHT - 60 * k, top - 4);
      });
      pen.fillStyle = "#6b6b6b";
      [tops[row] / 1.15, 0, -tops[row] / 1.15].forEach((v) => pen.fillText(+v.toPrecision(2), LEFT - 6, y(v) + 4));
    });
    const bottom = height - AXIS, each = step(span[1] - span[0]);
    pen.textAlign = "center";
    for (let t = Math.ceil(span[0] / each) * each; t <= span[1]; t += each) {
      line(x(t), bottom, x(t), bottom + 4, "#888");
      pen.fillText(+t.toPrecision(6), x(t), bottom + 15);
    }
    pen.textAlign = "right";
    pen.fillText("s since the start", width - RIGHT, bottom + 25);
    now.textContent = `${cursor.toFixed(2)} s`;
  };

  const timeAt = (event) => {
    const at = (event.offsetX - LEFT) / (canvas.clientWidth - LEFT - RIGHT);
    return span[0] + at * (span[1] - span[0]);
  };
  const within = (t) => Math.min(whole[1], Math.max(whole[0], t));
  const move = (t) => { cursor = within(t); draw(); };
  const zoom = (factor, about) => {
    span = span.map((end) => within(about + (end - about) * factor));
    draw();
  };
  canvas.addEventListener("pointermove", (event) => move(timeAt(event)));
  canvas.addEventListener("dblclick", () => { span = [...whole]; draw(); });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(event.deltaY > 0 ? 1.25 : 0.8, timeAt(event));
  }, { passive: false });
  box.addEventListener("keydown", (event) => {
    const far = (span[1] - span[0]) / 200;
    if (event.key === "ArrowRight") move(cursor + far);
    else if (event.key === "ArrowLeft") move(cursor - far);
    else if (event.key === "+") zoom(0.8, cursor);
    else if (event.key === "-") zoom(1.25, cursor);
    else return;
    event.preventDefault();
  });
  window.addEventListener("resize", draw);
  draw();
})();
