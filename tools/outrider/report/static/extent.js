// The bounds of all paths, obstacles and goals, and the points that have to be in the picture.
function extent(from, to) {
  const points = [];
  const low = [Infinity, Infinity, 0];
  const high = [-Infinity, -Infinity, 1];
  const hold = (point, size = 0) => {
    for (let i = 0; i < 3; i++) {
      low[i] = Math.min(low[i], point[i] - (i < 2 ? size : 0));
      high[i] = Math.max(high[i], point[i] + size);
    }
    points.push([point[0], point[1], point[2] + size]);
  };
  const often = Math.max(1, Math.ceil((flight.time.length * flight.systems.length) / MOST_POINTS));
  flight.time.forEach((time, index) => {
    if (time < from || time > to || index % often) return;
    const here = { index, next: index, share: 0 };
    flight.systems.forEach((_, k) => {
      const at = vector(flight.position, k, here);
      if (at) hold(at, 0.5);
    });
    const target = vector(flight.target, 0, here);
    if (target) hold(target);
    // Corners of what surrounds it are enough; it is round.
    if (target && (index / often) % 10 === 0) {
      for (const { line } of run.scene.surfaces) {
        for (let i = 0; i < line.length; i += 9) hold(line[i].map((value, axis) => value + target[axis]));
      }
    }
    run.scene.movers.forEach((mover, j) => {
      const at = vector(flight.moving, j, here);
      if (at) hold(at, mover.radius);
    });
  });
  // Of boxes those near the flight: a world of them may be far larger.
  const wide = Math.max(LEAST_AROUND, 0.5 * Math.max(high[0] - low[0], high[1] - low[1]));
  const [least, most] = [low.map((value) => value - wide), high.map((value) => value + wide)];
  for (const one of run.scene.fixed) {
    if (one.kind === "box") {
      const { corners, low: lowest } = prismOf(one);
      const near = corners.filter((corner) => corner.every((value, i) => value >= least[i] && value <= most[i]));
      for (const corner of near) hold([...corner, Math.max(lowest, 0)]);
    } else hold([one.at[0], one.at[1], one.kind === "sphere" ? one.at[2] : 0], one.radius);
  }
  for (const goal of run.scene.goals) hold(goal);
  if (!points.length) hold([0, 0, 0], 5);
  // Sixteen lines or fewer to a side.
  const size = Math.max(high[0] - low[0], high[1] - low[1]);
  const square = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].find((width) => size / width <= 16) ?? 2000;
  for (const x of [low[0], high[0]]) for (const y of [low[1], high[1]]) points.push([x, y, 0]);
  return { low, high, square, points };
}

const MOST_POINTS = 3000;
// m beside the flight that are in the picture if boxes stand there.
const LEAST_AROUND = 5;

let bounds = null;
