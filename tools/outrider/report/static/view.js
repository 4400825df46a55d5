// The replay on its canvas: size, light, fingers, mouse and keys.

const canvas = document.getElementById("view");
const painter = canvas.getContext("2d");
let waiting = false;
let chasing = false;

function draw() {
  waiting = false;
  const { width, height } = camera;
  const scale = canvas.width / width;
  painter.setTransform(scale, 0, 0, scale, 0, 0);
  painter.clearRect(0, 0, width, height);
  if (chasing) keepInMiddle();
  aim();
  const pair = scene(painter, cursor.time);
  scaleBar(painter);
  const now = document.getElementById("now");
  const near = pair && run.scene.dMin && pair.distance < run.scene.dMin;
  now.classList.toggle("bad", Boolean(near));
  const who = pair ? ` · nearest ${pair.distance.toFixed(2)} m, ${pair.who.map((k) => flight.systems[k]).join("–")}` : "";
  now.textContent = `${cursor.time.toFixed(2)} s${who}`;
}

function redraw() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(draw);
}

function keepInMiddle() {
  const places = fleetAt(cursor.time);
  if (!places.length) return;
  camera.centre = [0, 1, 2].map((i) => places.reduce((sum, point) => sum + point[i], 0) / places.length);
}

function fleetAt(time) {
  const here = place(time);
  return flight.systems.map((_, k) => vector(flight.position, k, here)).filter(Boolean);
}

// A bar of a whole number of metres, true in the middle of the picture: with perspective near things are larger.
function scaleBar(g) {
  const pixels = pixelsPerMetre(camera.distance);
  const metres = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500].findLast((n) => n * pixels <= 120) ?? 0.1;
  const x = camera.width - 16 - metres * pixels;
  const y = camera.height - 14;
  const length = metres * pixels;
  g.strokeStyle = ink.ink;
  g.lineWidth = 1.5;
  g.beginPath();
  g.moveTo(x, y - 5);
  g.lineTo(x, y);
  g.lineTo(x + length, y);
  g.lineTo(x + length, y - 5);
  g.stroke();
  words(g, `${metres} m`, x + length / 2, y - 10, ink.ink);
}

// The canvas has as many points as the screen has, or more for paper. A new size empties it: draw at once.
function resize(density = window.devicePixelRatio || 1) {
  const { clientWidth, clientHeight } = canvas;
  const [width, height] = [Math.round(clientWidth * density), Math.round(clientHeight * density)];
  if (!width || (width === canvas.width && height === canvas.height)) return;
  [camera.width, camera.height] = [clientWidth, clientHeight];
  [canvas.width, canvas.height] = [width, height];
  if (bounds) draw();
}

function home() {
  chase(false);
  flatten(false);
  camera.azimuth = -1.15;
  camera.elevation = camera.height > camera.width ? 0.85 : 0.55;
  fit(bounds.points);
  redraw();
}

// Without perspective: a metre is as long everywhere, north is up.
function fromAbove() {
  flatten(true);
  camera.azimuth = -Math.PI / 2;
  camera.elevation = Math.PI / 2;
  fit(chasing ? around(cursor.time) : bounds.points);
  redraw();
}

function flatten(on) {
  camera.flat = on;
  document.getElementById("top").setAttribute("aria-pressed", on);
}

// The camera moves with the fleet, as near to it as it may be.
function chase(on) {
  if (on && !chasing) fit(around(cursor.time));
  chasing = on;
  document.getElementById("chase").setAttribute("aria-pressed", on);
  redraw();
}

// The fleet, and what surrounds the target, at a time.
function around(time) {
  const places = fleetAt(time);
  const target = vector(flight.target, 0, place(time));
  if (target && run.scene.surfaces.length) {
    places.push(target);
    for (const { line } of run.scene.surfaces) {
      for (let i = 0; i < line.length; i += 9) places.push(line[i].map((value, axis) => value + target[axis]));
    }
  }
  if (!places.length) return bounds.points;
  return places.flatMap((point) => [-1, 1].map((side) => point.map((value) => value + side)));
}

function turnBy(dx, dy) {
  flatten(false);
  orbit(dx, dy);
}

const fingers = new Map();

canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  canvas.focus({ preventScroll: true });
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
});

for (const kind of ["pointerup", "pointercancel"]) {
  canvas.addEventListener(kind, (event) => fingers.delete(event.pointerId));
}

canvas.addEventListener("pointermove", (event) => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
  if (fingers.size === 1) {
    if (event.buttons & 6 || event.shiftKey) pan(dx, dy);
    else turnBy(dx * 0.008, dy * 0.008);
  } else {
    // Two fingers: what they have in common moves the scene, their distance zooms.
    const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
    const was = Math.hypot(before[0] - other[0], before[1] - other[1]);
    const is = Math.hypot(event.clientX - other[0], event.clientY - other[1]);
    if (was > 5 && is > 5) zoom(was / is);
    pan(dx / 2, dy / 2);
  }
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
  redraw();
});

canvas.addEventListener("contextmenu", (event) => event.preventDefault());

// Before a click the wheel scrolls the page, as it does everywhere else.
canvas.addEventListener(
  "wheel",
  (event) => {
    if (document.activeElement !== canvas && !event.ctrlKey) return;
    event.preventDefault();
    zoom(Math.exp(Math.sign(event.deltaY) * Math.min(0.25, Math.abs(event.deltaY) * 0.0015)));
    redraw();
  },
  { passive: false },
);

const KEYS = {
  " ": () => play(!cursor.playing),
  "+": () => zoom(0.9),
  "=": () => zoom(0.9),
  "-": () => zoom(1.1),
  "0": home,
  t: fromAbove,
  f: () => chase(!chasing),
  ",": () => moveTo(cursor.time - 0.04),
  ".": () => moveTo(cursor.time + 0.04),
};
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

canvas.addEventListener("keydown", (event) => {
  const arrow = ARROWS[event.key];
  if (arrow && event.shiftKey) pan(arrow[0] * 25, arrow[1] * 25);
  else if (arrow) turnBy(arrow[0] * 0.08, arrow[1] * 0.08);
  else if (KEYS[event.key] && !event.ctrlKey && !event.metaKey) KEYS[event.key]();
  else return;
  event.preventDefault();
  redraw();
});

// Space plays and pauses wherever the page has the focus, but on what space itself works.
document.addEventListener("keydown", (event) => {
  if (event.key !== " " || event.ctrlKey || event.metaKey || event.target === canvas) return;
  if (event.target.closest?.("input:not([type=range]), select, textarea, button, summary, a")) return;
  event.preventDefault();
  play(!cursor.playing);
});
