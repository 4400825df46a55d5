// The order in which things are drawn, from far to near. Boxes have upright sides: lines on the ground divide the
// ground until each part of it holds one box, or several above each other. What is on the eye's side of a line is
// nearer. A box that a line crosses is divided, too.

// At most this many boxes of a part of the ground, evenly chosen, give the lines by which it may be divided.
const TRIED = 4;

// A box as { corners: counter-clockwise on the ground, real: whether the side after a corner is one of the box's,
// low, high }.
function prismOf({ at, size, yaw }) {
  const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
  const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => {
    const [x, y] = [(a * size[0]) / 2, (b * size[1]) / 2];
    return [at[0] + c * x - s * y, at[1] + s * x + c * y];
  });
  return { corners, real: [true, true, true, true], low: at[2] - size[2] / 2, high: at[2] + size[2] / 2 };
}

// A line is [nx, ny, c]; a place is on its positive side where nx x + ny y > c.
function beyond(line, [x, y]) {
  return line[0] * x + line[1] * y - line[2];
}

// The line through the ith side of a prism, with the prism on its negative side.
function sideLine({ corners }, i) {
  const [a, b] = [corners[i], corners[(i + 1) % corners.length]];
  const length = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
  const [nx, ny] = [(b[1] - a[1]) / length, (a[0] - b[0]) / length];
  return [nx, ny, nx * a[0] + ny * a[1]];
}

const TOUCH = 1e-6;

// 1: all of it on the positive side, -1: on the negative one, 0: the line crosses it.
function sideOf(line, { corners }) {
  let least = Infinity;
  let most = -Infinity;
  for (let i = 0; i < corners.length; i++) {
    const off = line[0] * corners[i][0] + line[1] * corners[i][1] - line[2];
    if (off < least) least = off;
    if (off > most) most = off;
  }
  return least >= -TOUCH ? 1 : most <= TOUCH ? -1 : 0;
}

// The part of a prism on one side (±1) of a line that crosses it.
function cut(prism, line, sign) {
  const [corners, real] = [[], []];
  prism.corners.forEach((a, i) => {
    const b = prism.corners[(i + 1) % prism.corners.length];
    const [before, after] = [sign * beyond(line, a), sign * beyond(line, b)];
    if (before > 0) {
      corners.push(a);
      real.push(prism.real[i]);
    }
    if (before > 0 !== after > 0) {
      const share = before / (before - after);
      corners.push([a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]);
      // From here along the line, or along the prism's own side.
      real.push(before > 0 ? false : prism.real[i]);
    }
  });
  return { ...prism, corners, real };
}

// Lines along the sides of some of the prisms, and along the axes beside them.
function* linesOf(prisms) {
  const count = Math.min(TRIED, prisms.length);
  for (let k = 0; k < count; k++) {
    const prism = prisms[Math.floor(((k + 0.5) * prisms.length) / count)];
    for (let i = 0; i < prism.corners.length; i++) yield sideLine(prism, i);
    for (const axis of [0, 1]) {
      const values = prism.corners.map((corner) => corner[axis]);
      for (const value of [Math.min(...values), Math.max(...values)]) yield axis ? [0, 1, value] : [1, 0, value];
    }
  }
}

// A part of the ground: { prisms, things }, or { line, over, under } of its two sides.
function divide(prisms) {
  let best = null;
  if (prisms.length > 1) {
    for (const line of linesOf(prisms)) {
      let [over, under, crossed] = [0, 0, 0];
      for (const prism of prisms) {
        const side = sideOf(line, prism);
        if (side > 0) over++;
        else if (side < 0) under++;
        else crossed++;
      }
      const cost = 4 * crossed + Math.abs(over - under);
      if (over && under && !(best && best.cost <= cost)) best = { line, cost };
    }
  }
  if (!best) return { prisms, things: [] };
  const { line } = best;
  const [over, under] = [[], []];
  for (const prism of prisms) {
    const side = sideOf(line, prism);
    if (side >= 0) over.push(side ? prism : cut(prism, line, 1));
    if (side <= 0) under.push(side ? prism : cut(prism, line, -1));
  }
  return { line, over: divide(over), under: divide(under) };
}

const groundPlan = run && divide(run.scene.fixed.filter((one) => one.kind === "box").map(prismOf));

// The eye, or for a picture without perspective a place far away in its direction.
function viewpoint() {
  return camera.flat ? camera.centre.map((c, i) => c + 1e6 * camera.back[i]) : camera.eye;
}

// Whether a plane of the prism parts it from the place and the eye.
function inFrontOf(prism, place, eye) {
  if (Math.min(place[2], eye[2]) >= prism.high || Math.max(place[2], eye[2]) <= prism.low) return true;
  return prism.corners.some((_, i) => {
    const line = sideLine(prism, i);
    return beyond(line, eye) > 0 && beyond(line, place) >= 0;
  });
}

// Draws things { point, depth, draw } and all boxes.
function inOrder(g, things) {
  const eye = viewpoint();
  for (const thing of things) {
    let part = groundPlan;
    while (part.line) part = beyond(part.line, thing.point) > 0 ? part.over : part.under;
    part.things.push(thing);
  }
  const visit = (part) => {
    if (!part.line) return drawPart(g, part, eye);
    const near = beyond(part.line, eye) > 0;
    visit(near ? part.under : part.over);
    visit(near ? part.over : part.under);
  };
  visit(groundPlan);
}

// Of boxes above each other the one nearest to the eye's height is nearest; a thing comes after all that it is before.
function drawPart(g, part, eye) {
  const gap = ({ low, high }) => Math.max(low - eye[2], eye[2] - high, 0);
  const prisms = part.prisms.length > 1 ? [...part.prisms].sort((a, b) => gap(b) - gap(a)) : part.prisms;
  const slots = [...prisms.map(() => []), []];
  for (const thing of part.things) {
    const hides = prisms.findIndex((prism) => !inFrontOf(prism, thing.point, eye));
    slots[hides < 0 ? prisms.length : hides].push(thing);
  }
  part.things.length = 0;
  slots.forEach((slot, i) => {
    slot.sort((a, b) => b.depth - a.depth);
    for (const { draw } of slot) draw();
    if (i < prisms.length) block(g, prisms[i], eye);
  });
}
