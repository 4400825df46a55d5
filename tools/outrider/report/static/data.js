// The flight as it was embedded, and what it was at any time in between.

const run = JSON.parse(document.getElementById("run").textContent);

// Ten colours, then the same with dashes.
const COLOURS = 10;
const DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3]];

function stranger(k) {
  return k >= flight.systems.length - run.scene.bystanders;
}

// Of lines and bodies, and of text, which needs more contrast.
function colourOf(k) {
  return stranger(k) ? ink.bystander : ink[`vehicle-${k % COLOURS}`];
}

function labelColourOf(k) {
  return stranger(k) ? ink.soft : ink[`label-${k % COLOURS}`];
}

function dashOf(k) {
  return DASHES[Math.floor(k / COLOURS) % DASHES.length];
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
function place(time, times = flight.time) {
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

// The least distance of two vehicles, m: the run's own figure for the nearest sample, as in its chart and its file.
const separation = run && run.charts.find((one) => one.key === "separation");
const separations = separation && { times: decode(separation.time).values, values: decode(separation.values) };

function separationAt(time) {
  if (!separations) return NaN;
  const { index, next, share } = place(time, separations.times);
  return separations.values.values[(share < 0.5 ? index : next) * separations.values.row];
}

// The two vehicles that are nearest to each other: { distance, who: [j, k] }, or null if none are in the air.
function nearestPair(places, time) {
  const distance = separationAt(time);
  let [least, who] = [Infinity, null];
  for (let j = 0; j < places.length; j++) {
    for (let k = j + 1; k < places.length; k++) {
      if (!places[j] || !places[k] || apart(places[j], places[k]) >= least) continue;
      [least, who] = [apart(places[j], places[k]), [j, k]];
    }
  }
  return who && Number.isFinite(distance) ? { distance, who } : null;
}
