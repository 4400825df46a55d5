// Shapes in the picture: each is given the canvas, and places in the world.

let ink = {};

// The colours of the page as they are now: light, dark or on paper.
function mix() {
  const style = getComputedStyle(document.documentElement);
  const names = ["paper", "ink", "soft", "line", "grid", "bad", "accent", "solid", "bystander", "target", "label-target", "shadow"];
  for (let k = 0; k < COLOURS; k++) names.push(`vehicle-${k}`, `label-${k}`);
  ink = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  ink.shades = Array.from({ length: SHADES }, (_, k) => blend(ink.solid, ink.shadow, (0.5 * k) / (SHADES - 1)));
}

// Joined places; it breaks where one is missing or behind the eye.
function polyline(g, places, close = false) {
  g.beginPath();
  let down = false;
  for (const point of places) {
    const seen = point && project(point);
    if (!seen) {
      down = false;
    } else if (down) {
      g.lineTo(seen[0], seen[1]);
    } else {
      g.moveTo(seen[0], seen[1]);
      down = true;
    }
  }
  if (close && down) g.closePath();
}

function ring(centre, radius, across, along, count = 28) {
  const places = [];
  for (let i = 0; i <= count; i++) {
    const turn = (2 * Math.PI * i) / count;
    const [c, s] = [radius * Math.cos(turn), radius * Math.sin(turn)];
    places.push(centre.map((value, axis) => value + c * across[axis] + s * along[axis]));
  }
  return places;
}

function level(centre, radius) {
  return ring(centre, radius, [1, 0, 0], [0, 1, 0]);
}

function words(g, text, x, y, colour, align = "center") {
  g.font = "600 12px system-ui, sans-serif";
  g.textAlign = align;
  g.textBaseline = "middle";
  g.lineWidth = 3;
  g.lineJoin = "round";
  g.strokeStyle = ink.paper;
  g.strokeText(text, x, y);
  g.fillStyle = colour;
  g.fillText(text, x, y);
}

function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

// A multirotor: arms, hub, nose, and rotors that turn with the time shown. Small ones are drawn larger.
function multirotor(g, centre, { yaw, axis }, colour, time) {
  const seen = project(centre);
  if (!seen) return;
  const { span, hubs, spins, disc } = run.scene.airframe;
  const scale = pixelsPerMetre(seen[2]);
  const size = Math.max(span * scale, Math.min(34, camera.width / 18)) / scale;
  const pixels = size * scale;
  const forward = [Math.cos(yaw), Math.sin(yaw), 0];
  const lean = dot(forward, axis);
  let nose = forward.map((value, i) => value - lean * axis[i]);
  const length = Math.hypot(...nose) || 1;
  nose = nose.map((value) => value / length);
  const left = cross(axis, nose);
  // In shares of the size: forward, left, up.
  const at = (x, y, z = 0) => centre.map((value, i) => value + size * (x * nose[i] + y * left[i] + z * axis[i]));
  g.lineCap = "round";
  g.strokeStyle = ink.ink;
  g.lineWidth = Math.max(1.2, 0.035 * pixels);
  for (const [x, y] of hubs) {
    polyline(g, [at(0, 0), at(x, y), at(x, y, 0.05)]);
    g.stroke();
  }
  polyline(g, [at(0.1, 0.09), at(0.25, 0), at(0.1, -0.09)], true);
  g.fillStyle = colour;
  g.fill();
  polyline(g, ring(at(0, 0), 0.1 * size, nose, left, 14), true);
  g.fillStyle = ink.ink;
  g.fill();
  hubs.forEach(([x, y], k) => {
    const hub = at(x, y, 0.05);
    polyline(g, ring(hub, disc * size, nose, left, 18), true);
    g.fillStyle = g.strokeStyle = colour;
    g.globalAlpha = 0.5;
    g.fill();
    g.globalAlpha = 1;
    g.lineWidth = 1;
    g.stroke();
    const turn = 2 * Math.PI * TURNS * time * spins[k] + k;
    const [c, s] = [0.92 * disc * Math.cos(turn), 0.92 * disc * Math.sin(turn)];
    polyline(g, [at(x - c, y - s, 0.05), at(x + c, y + s, 0.05)]);
    g.strokeStyle = ink.ink;
    g.lineWidth = Math.max(1, 0.025 * pixels);
    g.stroke();
  });
  g.lineCap = "butt";
}

// Turns of a drawn rotor in a second of flight: a real one would be a blur.
const TURNS = 1.7;

// As large as a ball of this radius (m) looks.
function ball(g, centre, radius, fill, edge, alpha) {
  const seen = project(centre);
  if (!seen) return;
  g.beginPath();
  g.arc(seen[0], seen[1], radius * pixelsPerMetre(seen[2]), 0, 2 * Math.PI);
  g.globalAlpha = alpha;
  g.fillStyle = fill;
  g.fill();
  g.globalAlpha = Math.min(1, alpha * 4);
  g.strokeStyle = edge;
  g.lineWidth = 1;
  g.stroke();
  g.globalAlpha = 1;
}

// A post: its sides are the quads between two rings, the far ones first.
function post(g, [x, y], radius, top) {
  const [low, high] = [level([x, y, 0], radius), level([x, y, top], radius)];
  const sides = low.slice(1).map((_, i) => [low[i], low[i + 1], high[i + 1], high[i]]);
  sides.sort((a, b) => depth(b[0]) - depth(a[0]));
  for (const side of [...sides, high]) {
    polyline(g, side, true);
    g.fillStyle = g.strokeStyle = ink.solid;
    g.lineWidth = 0.7;
    g.fill();
    g.stroke();
  }
  g.strokeStyle = ink.soft;
  polyline(g, high, true);
  g.stroke();
}

function depth(point) {
  return dot(
    point.map((value, i) => camera.eye[i] - value),
    camera.back,
  );
}
