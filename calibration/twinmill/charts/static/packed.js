// SPDX-License-Identifier: Apache-2.0
// Reads what twinmill.charts.packed.pack wrote.

/** Facts, and arrays by name: `data` (Float32Array, row by row), `rows`, `width` of a row. */
export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const facts = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const arrays = {};
  let at = 4 + length;
  for (const [name, shape] of Object.entries(facts.arrays)) {
    const count = shape.reduce((a, b) => a * b, 1);
    const data = new Float32Array(buffer, at, count);
    arrays[name] = { data, rows: shape[0], width: shape[0] ? count / shape[0] : 0 };
    at += 4 * count;
  }
  return { ...facts, arrays };
}

/** Last row whose first number is no more than t; -1 before the first. Rows ascend in time. */
export function rowAt({ data, rows, width }, t) {
  let low = 0;
  let high = rows;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (data[middle * width] <= t) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** Values of the array at t, between two rows; null where it is not known. */
export function valuesAt(array, t, reach = 0.3) {
  const { data, rows, width } = array;
  const k = rows && t < data[0] && data[0] - t <= reach ? 0 : rowAt(array, t);
  if (k < 0) return null;
  const here = data.subarray(k * width, (k + 1) * width);
  if (t - here[0] > reach || Number.isNaN(here[1])) return null;
  if (k + 1 >= rows || t <= here[0]) return here;
  const next = data.subarray((k + 1) * width, (k + 2) * width);
  if (Number.isNaN(next[1])) return here;
  const share = (t - here[0]) / Math.max(next[0] - here[0], 1e-9);
  return here.map((v, i) => v + share * (next[i] - v));
}
