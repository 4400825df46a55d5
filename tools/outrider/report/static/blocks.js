// Boxes in the picture, each side in its own shade.

// From light to dark.
const SHADES = 8;
// Pixels: a smaller box has no lines along its edges.
const LEAST = 60;

// A share of the second colour in the first one; both are #rrggbb.
function blend(one, other, share) {
  const parts = [1, 3, 5].map((i) => [one, other].map((code) => Number.parseInt(code.slice(i, i + 2), 16)));
  return `rgb(${parts.map(([a, b]) => Math.round(a + share * (b - a))).join(" ")})`;
}

// The visible sides of a part of a box, which hide nothing of each other. It is drawn no higher than the flight.
function block(g, { corners, real, low, high }, eye) {
  const top = Math.min(high, bounds.high[2] + 1);
  const bottom = Math.max(low, 0);
  const count = corners.length;
  const level = eye[2] > top ? top : eye[2] < bottom ? bottom : null;
  const [lower, upper] = [bottom, top].map((z) => corners.map(([x, y]) => [x, y, z]));
  const fine = large([...lower, ...upper]);
  if (fine === null) return;
  const edges = [];
  for (let i = 0; i < count; i++) {
    const j = (i + 1) % count;
    const [a, b] = [corners[i], corners[j]];
    const out = [b[1] - a[1], a[0] - b[0]];
    if (!real[i] || out[0] * (eye[0] - a[0]) + out[1] * (eye[1] - a[1]) <= 0) continue;
    const share = 0.5 - (0.28 * out[0] + 0.21 * out[1]) / (Math.hypot(out[0], out[1]) || 1);
    face(g, [lower[i], lower[j], upper[j], upper[i]], ink.shades[Math.round(share * (SHADES - 1))], fine);
    edges.push(lower[i], lower[j], null, upper[i], upper[j], null);
    // Where the box was divided it has no edge.
    if (real[(i + count - 1) % count]) edges.push(lower[i], upper[i], null);
    if (real[j]) edges.push(lower[j], upper[j], null);
  }
  if (level !== null) {
    const flat = level === top ? upper : lower;
    face(g, flat, ink.shades[level === top ? 0 : SHADES - 1], fine);
    for (let i = 0; i < count; i++) if (real[i]) edges.push(flat[i], flat[(i + 1) % count], null);
  }
  if (!fine) return;
  polyline(g, edges);
  g.strokeStyle = ink.soft;
  g.lineWidth = 0.7;
  g.stroke();
}

// Whether what has these corners is large in the picture; null if none of it is in the picture.
function large(places) {
  let [left, right, top, bottom] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const point of places) {
    const seen = project(point);
    if (!seen) return true;
    left = Math.min(left, seen[0]);
    right = Math.max(right, seen[0]);
    top = Math.min(top, seen[1]);
    bottom = Math.max(bottom, seen[1]);
  }
  if (right < 0 || left > camera.width || bottom < 0 || top > camera.height) return null;
  return Math.max(right - left, bottom - top) > LEAST;
}

// A flat polygon; with a line round it no gap shows beside the next one.
function face(g, places, colour, lined) {
  g.beginPath();
  let begun = false;
  for (const point of inFront(places)) {
    const [x, y] = project(point);
    if (begun) g.lineTo(x, y);
    else g.moveTo(x, y);
    begun = true;
  }
  g.closePath();
  g.fillStyle = colour;
  g.fill();
  if (!lined) return;
  g.strokeStyle = colour;
  g.lineWidth = 0.7;
  g.stroke();
}

// The part of a polygon in front of the eye.
function inFront(places) {
  if (camera.flat || places.every(project)) return places;
  const found = [];
  places.forEach((a, i) => {
    const b = places[(i + 1) % places.length];
    const [near, far] = [depth(a) - 1.01 * NEAR, depth(b) - 1.01 * NEAR];
    if (near >= 0) found.push(a);
    if (near >= 0 !== far >= 0) found.push(a.map((value, k) => value + (near / (near - far)) * (b[k] - value)));
  });
  return found;
}
