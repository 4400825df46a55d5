// What is seen at a time: a list of things with their places and depths, drawn from far to near among the boxes.

const show = { trail: 5, spheres: true, references: true, ids: true, cameras: true };

function scene(g, time) {
  const here = place(time);
  const all = flight.systems.map((_, k) => vector(flight.position, k, here));
  const places = all.map((point, k) => (cursor.hidden.has(k) ? null : point));
  const target = vector(flight.target, 0, here);
  const things = [];
  const add = (point, draw, nearer = 0) => point && things.push({ point, depth: depth(point) - nearer, draw });
  ground(g);
  fixed(g, add);
  movers(g, add, here);
  goals(g, add);
  surfaces(g, target);
  if (target) add(target, () => star(g, target));
  trails(g, add, time);
  const pair = nearestPair(all, time);
  if (pair) nearest(g, add, places, pair);
  places.forEach((point, k) => point && vehicle(g, add, point, k, here, time));
  if (run.cameras && show.cameras) places.forEach((point, k) => point && sight(g, add, point, k, here));
  inOrder(g, things);
  if (show.ids) places.forEach((point, k) => point && label(g, point, String(flight.systems[k]), labelColourOf(k)));
  if (show.ids && target) label(g, target, "target", ink["label-target"], 1);
  return pair;
}

// Vehicles have theirs above (side -1) and the target below it (1), so that those of a vehicle in front stay legible.
function label(g, point, text, colour, side = -1) {
  const seen = project(point);
  if (seen) words(g, text, seen[0], seen[1] + side * Math.max(19, 0.55 * pixelsPerMetre(seen[2])), colour);
}

// A grid on the ground with its scale along two edges.
function ground(g) {
  const { low, high, square } = bounds;
  const [[x0, y0], [x1, y1]] = [low, high];
  const columns = lines(x0, x1, square);
  const rows = lines(y0, y1, square);
  g.lineWidth = 1;
  const line = (a, b, zero) => {
    g.strokeStyle = zero ? ink.solid : ink.grid;
    polyline(g, [a, b]);
    g.stroke();
  };
  for (const x of [x0, ...columns, x1]) line([x, y0, 0], [x, y1, 0], x === 0);
  for (const y of [y0, ...rows, y1]) line([x0, y, 0], [x1, y, 0], y === 0);
  // The edges that are nearer to the eye.
  const [edgeX, edgeY] = [Math.cos(camera.azimuth) < 0 ? x0 : x1, Math.sin(camera.azimuth) < 0 ? y0 : y1];
  const [offX, offY] = [edgeX === x0 ? -1 : 1, edgeY === y0 ? -1 : 1];
  columns.forEach((x, i) => number(g, [x, edgeY, 0], [0, offY, 0], i === columns.length - 1 ? `${x} m E` : x));
  rows.forEach((y, i) => number(g, [edgeX, y, 0], [offX, 0, 0], i === rows.length - 1 ? `${y} m N` : y));
}

function lines(from, to, step) {
  const found = [];
  for (let n = Math.ceil(from / step); n * step <= to; n++) found.push(n * step);
  return found;
}

// A number a few pixels beside an edge, outwards.
function number(g, at, out, text) {
  const here = project(at);
  const there = project(at.map((value, i) => value + 0.1 * out[i]));
  if (!here || !there) return;
  const [dx, dy] = [there[0] - here[0], there[1] - here[1]];
  const length = Math.hypot(dx, dy) || 1;
  g.font = "11px system-ui, sans-serif";
  g.fillStyle = ink.soft;
  g.textAlign = dx / length > 0.5 ? "left" : dx / length < -0.5 ? "right" : "center";
  g.textBaseline = "middle";
  g.fillText(String(text), here[0] + (9 * dx) / length, here[1] + (13 * dy) / length);
}

function fixed(g, add) {
  for (const one of run.scene.fixed) if (one.kind !== "box") solid(g, add, one, one.at);
}

function movers(g, add, here) {
  run.scene.movers.forEach((mover, j) => {
    const at = vector(flight.moving, j, here);
    if (!at) return;
    solid(g, add, mover, at);
    const top = mover.kind === "post" ? [at[0], at[1], postTop(mover)] : [at[0], at[1], at[2] + mover.radius];
    if (show.ids) add(top, () => label(g, top, String(mover.id), ink.soft), 2);
  });
}

// A post or a box that reaches beyond the flight is drawn as high as that.
function postTop(one) {
  return Math.min(one.height, bounds.high[2] + 1);
}

function solid(g, add, one, at) {
  if (one.kind === "post") {
    const middle = [at[0], at[1], 0.5 * postTop(one)];
    add(middle, () => post(g, at, one.radius, postTop(one)));
  } else {
    add(at, () => ball(g, at, one.radius, ink.solid, ink.soft, 0.85));
    shadow(g, at, one.radius);
  }
}

// On the ground, darker and smaller the lower the body is.
function shadow(g, at, radius) {
  polyline(g, level([at[0], at[1], 0], radius * (1 + 0.03 * Math.max(at[2], 0))), true);
  g.globalAlpha = 0.12 + 0.25 / (1 + 0.25 * Math.max(at[2], 0));
  g.fillStyle = ink.shadow;
  g.fill();
  g.globalAlpha = 1;
}

function goals(g, add) {
  run.scene.goals.forEach((goal, k) => {
    if (!cursor.hidden.has(k)) add(goal, () => mark(g, goal, colourOf(k)));
  });
}

function mark(g, goal, colour) {
  polyline(g, level(goal, 0.3), true);
  g.strokeStyle = colour;
  g.lineWidth = 1.6;
  g.stroke();
}

function surfaces(g, target) {
  if (!target) return;
  for (const { of, line } of run.scene.surfaces) {
    const k = flight.systems.indexOf(of);
    polyline(g, line.map((offset) => offset.map((value, i) => value + target[i])));
    g.strokeStyle = k < 0 ? ink.soft : colourOf(k);
    g.lineWidth = 1.2;
    g.setLineDash([5, 4]);
    g.stroke();
    g.setLineDash([]);
  }
}

function star(g, at) {
  shadow(g, at, 0.25);
  stem(g, at, ink.soft);
  const [x, y] = project(at) ?? [];
  if (x === undefined) return;
  g.beginPath();
  for (let i = 0; i < 10; i++) {
    const turn = (Math.PI * i) / 5 - Math.PI / 2;
    g.lineTo(x + (i % 2 ? 4 : 10) * Math.cos(turn), y + (i % 2 ? 4 : 10) * Math.sin(turn));
  }
  g.closePath();
  g.fillStyle = ink.target;
  g.strokeStyle = ink.ink;
  g.lineWidth = 1;
  g.fill();
  g.stroke();
}

function stem(g, at, colour) {
  polyline(g, [at, [at[0], at[1], 0]]);
  g.globalAlpha = 0.35;
  g.strokeStyle = colour;
  g.lineWidth = 1;
  g.stroke();
  g.globalAlpha = 1;
}
