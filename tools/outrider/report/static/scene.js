// What is seen at a time: a list of things with their depths, drawn from far to near.

const show = { trail: 5, spheres: true, references: true, ids: true };

function scene(g, time) {
  const here = place(time);
  const places = flight.systems.map((_, k) => (cursor.hidden.has(k) ? null : vector(flight.position, k, here)));
  const target = vector(flight.target, 0, here);
  const things = [];
  const add = (point, draw, nearer = 0) => point && things.push({ depth: depth(point) - nearer, draw });
  ground(g);
  fixed(g, add);
  movers(g, add, here);
  goals(g);
  surfaces(g, target);
  if (target) add(target, () => star(g, target));
  trails(g, add, time);
  const pair = nearestPair(places);
  if (pair) nearest(g, add, places, pair);
  places.forEach((point, k) => point && vehicle(g, add, point, k, here, time));
  things.sort((a, b) => b.depth - a.depth);
  for (const { draw } of things) draw();
  if (show.ids) places.forEach((point, k) => point && label(g, point, String(flight.systems[k]), colourOf(k)));
  return pair;
}

function label(g, point, text, colour) {
  const seen = project(point);
  if (seen) words(g, text, seen[0], seen[1] - Math.max(16, (0.55 * camera.focus) / seen[2]), colour);
}

// The box that holds all paths, obstacles and goals.
function extent(from, to) {
  const low = [Infinity, Infinity, 0];
  const high = [-Infinity, -Infinity, 1];
  const hold = (point, size = 0) => {
    for (let i = 0; i < 3; i++) {
      low[i] = Math.min(low[i], point[i] - (i < 2 ? size : 0));
      high[i] = Math.max(high[i], point[i] + size);
    }
  };
  flight.time.forEach((time, index) => {
    if (time < from || time > to) return;
    const here = { index, next: index, share: 0 };
    flight.systems.forEach((_, k) => hold(vector(flight.position, k, here) ?? [0, 0, 0], 0.5));
    const target = vector(flight.target, 0, here);
    if (target) hold(target);
    // Corners of what surrounds it are enough; it is round.
    if (target && index % 10 === 0) {
      for (const { line } of run.scene.surfaces) {
        for (let i = 0; i < line.length; i += 9) hold(line[i].map((value, axis) => value + target[axis]));
      }
    }
    run.scene.movers.forEach((mover, j) => {
      const at = vector(flight.moving, j, here);
      if (at) hold(at, mover.radius);
    });
  });
  for (const one of run.scene.fixed) hold([one.at[0], one.at[1], one.kind === "sphere" ? one.at[2] : 0], one.radius);
  for (const goal of run.scene.goals) hold(goal);
  // The ground is a whole number of squares, twelve or fewer to a side.
  const size = Math.max(high[0] - low[0], high[1] - low[1]);
  const square = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].find((width) => size / width <= 12) ?? 2000;
  for (const axis of [0, 1]) {
    low[axis] = Math.floor(low[axis] / square) * square;
    high[axis] = Math.ceil(high[axis] / square) * square;
  }
  return { low, high, square };
}

let bounds = null;

// A grid on the ground with its scale along two edges.
function ground(g) {
  const step = bounds.square;
  const [[x0, y0], [x1, y1]] = [bounds.low, bounds.high];
  g.lineWidth = 1;
  const line = (a, b, zero) => {
    g.strokeStyle = zero ? ink.solid : ink.grid;
    polyline(g, [a, b]);
    g.stroke();
  };
  for (let x = x0; x <= x1 + 1e-6; x += step) line([x, y0, 0], [x, y1, 0], Math.abs(x) < 1e-6);
  for (let y = y0; y <= y1 + 1e-6; y += step) line([x0, y, 0], [x1, y, 0], Math.abs(y) < 1e-6);
  const south = camera.azimuth % (2 * Math.PI);
  const edgeY = Math.sin(south) < 0 ? y0 : y1;
  const edgeX = Math.cos(south) < 0 ? x0 : x1;
  g.font = "11px system-ui, sans-serif";
  g.fillStyle = ink.soft;
  g.textAlign = "center";
  g.textBaseline = "middle";
  const number = (point, text) => {
    const seen = project(point);
    if (seen) g.fillText(text, seen[0], seen[1]);
  };
  const out = 0.45 * step;
  const offY = edgeY + (edgeY === y0 ? -out : out);
  const offX = edgeX + (edgeX === x0 ? -out : out);
  for (let x = x0; x <= x1 + 1e-6; x += step) number([x, offY, 0], x === x1 ? `${x} m east` : `${x}`);
  for (let y = y0; y <= y1 + 1e-6; y += step) number([offX, y, 0], y === y1 ? `${y} m north` : `${y}`);
}

function fixed(g, add) {
  for (const one of run.scene.fixed) solid(g, add, one, one.at);
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

// A post that reaches beyond the flight is drawn as high as that.
function postTop(one) {
  return Math.min(one.height, bounds.high[2] + 1);
}

function solid(g, add, one, at) {
  if (one.kind === "post") {
    const middle = [at[0], at[1], 0.5 * postTop(one)];
    add(middle, () => post(g, at, one.radius, postTop(one)));
  } else {
    add(at, () => ball(g, at, one.radius, ink.solid, ink.soft, 0.85));
    shadow(g, at, one.radius, ink.soft);
  }
}

function shadow(g, at, radius, colour) {
  polyline(g, level([at[0], at[1], 0], radius), true);
  g.globalAlpha = 0.18;
  g.fillStyle = colour;
  g.fill();
  g.globalAlpha = 1;
}

function goals(g) {
  run.scene.goals.forEach((goal, k) => {
    if (cursor.hidden.has(k)) return;
    polyline(g, level(goal, 0.3), true);
    g.strokeStyle = colourOf(k);
    g.lineWidth = 1.6;
    g.stroke();
  });
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
  shadow(g, at, 0.25, ink.ink);
  stem(g, at, ink.soft);
  const [x, y] = project(at) ?? [];
  if (x === undefined) return;
  g.beginPath();
  for (let i = 0; i < 10; i++) {
    const turn = (Math.PI * i) / 5 - Math.PI / 2;
    g.lineTo(x + (i % 2 ? 4 : 10) * Math.cos(turn), y + (i % 2 ? 4 : 10) * Math.sin(turn));
  }
  g.closePath();
  g.fillStyle = ink.ink;
  g.fill();
  if (show.ids) words(g, "target", x, y - 18, ink.ink);
}

function stem(g, at, colour) {
  polyline(g, [at, [at[0], at[1], 0]]);
  g.globalAlpha = 0.35;
  g.strokeStyle = colour;
  g.lineWidth = 1;
  g.stroke();
  g.globalAlpha = 1;
}
