// The flight as it was embedded, and what it was at any time in between.

const run = JSON.parse(document.getElementById("run").textContent);

// Ten that stay apart for the colour-blind too (M. Petroff, Accessible Color Sequences, 2021); after that dashes.
const COLOURS = [
  "#3f90da", "#ffa90e", "#bd1f01", "#94a4a2", "#832db6", "#a96b59", "#e76300", "#b9ac70", "#717581", "#92dadd",
];
// The same on a dark ground, the dark ones lighter.
const LIT = [
  "#4f9ee8", "#ffb020", "#ea4a30", "#a3b3b1", "#b06fe0", "#c38775", "#f0721a", "#c6ba82", "#9397a3", "#9be3e6",
];
const DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3]];

function dark() {
  return matchMedia("(prefers-color-scheme: dark)").matches && !("print" in document.documentElement.dataset);
}

function colourOf(k) {
  return (dark() ? LIT : COLOURS)[k % COLOURS.length];
}

function dashOf(k) {
  return DASHES[Math.floor(k / COLOURS.length) % DASHES.length];
}

// Whole multiples of a quantum, little endian as every browser is; the least integer is NaN.
function decode({ shape, kind, quantum, data }) {
  const text = atob(data);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  const whole = kind === "i2" ? new Int16Array(bytes.buffer) : new Int32Array(bytes.buffer);
  const nothing = kind === "i2" ? -(2 ** 15) : -(2 ** 31);
  const values = Float64Array.from(whole, (n) => (n === nothing ? NaN : n * quantum));
  return { values, row: shape.slice(1).reduce((a, b) => a * b, 1) };
}

const flight = run && {
  systems: run.systems,
  time: decode(run.time).values,
  position: decode(run.position),
  velocity: decode(run.velocity),
  reference: decode(run.reference),
  yaw: decode(run.yaw),
  tilt: decode(run.tilt),
  target: decode(run.target),
  moving: decode(run.moving),
  axis: run.cameras && decode(run.cameras.axis),
  seen: run.cameras && decode(run.cameras.seen),
};

// Where a time lies: between which samples, and how far from the first to the second.
function place(time) {
  const times = flight.time;
  let low = 0;
  let high = times.length - 1;
  if (high < 1 || time <= times[0]) return { index: 0, next: 0, share: 0 };
  if (time >= times[high]) return { index: high, next: high, share: 0 };
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  return { index: low, next: high, share: (time - times[low]) / (times[high] - times[low]) };
}

function between(a, b, share) {
  if (Number.isNaN(a)) return b;
  if (Number.isNaN(b)) return a;
  return a + (b - a) * share;
}

// The vector (3) of the kth thing of an array at a place; null where there is none.
function vector(array, k, { index, next, share }) {
  const { values, row } = array;
  const a = index * row + 3 * k;
  const b = next * row + 3 * k;
  const found = [0, 1, 2].map((axis) => between(values[a + axis], values[b + axis], share));
  return found.some(Number.isNaN) ? null : found;
}

function angle(array, k, { index, next, share }) {
  const a = array.values[index * array.row + k];
  const b = array.values[next * array.row + k];
  const turn = Math.atan2(Math.sin(b - a), Math.cos(b - a));
  return Number.isNaN(turn) ? 0 : a + turn * share;
}

// Heading, and the axis of thrust: how far it leans is known, and where to is taken from the acceleration.
function attitude(k, time) {
  const here = place(time);
  const before = vector(flight.velocity, k, place(time - 0.06));
  const after = vector(flight.velocity, k, place(time + 0.06));
  const tilt = angle(flight.tilt, k, here);
  const push = before && after ? [after[0] - before[0], after[1] - before[1]] : [0, 0];
  const size = Math.hypot(...push);
  const lean = size > 1e-3 ? Math.sin(tilt) / size : 0;
  return { yaw: angle(flight.yaw, k, here), axis: [push[0] * lean, push[1] * lean, lean ? Math.cos(tilt) : 1] };
}

function apart(a, b) {
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

// The two vehicles that are nearest to each other: { distance, who: [j, k] }, or null.
function nearestPair(places) {
  let found = null;
  for (let j = 0; j < places.length; j++) {
    for (let k = j + 1; k < places.length; k++) {
      if (!places[j] || !places[k]) continue;
      const distance = apart(places[j], places[k]);
      if (!found || distance < found.distance) found = { distance, who: [j, k] };
    }
  }
  return found;
}
