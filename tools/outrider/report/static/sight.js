// What a vehicle's camera sees: its field of view, and a ray to what it detects.

function sight(g, add, at, k, { index }) {
  // An image holds until the next one: nothing is in between.
  const held = { index, next: index, share: 0 };
  const colour = colourOf(k);
  const axis = vector(flight.axis, k, held);
  const fields = run.cameras.fields[k];
  if (axis && fields) add(at, () => field(g, at, axis, fields, colour), 0.02);
  const seen = vector(flight.seen, k, held);
  if (seen) add(seen, () => ray(g, at, seen, colour));
}

// Four edges and the rectangle at their ends. The axis: heading from east, pitch upwards, roll clockwise.
function field(g, at, [heading, pitch, roll], [across, down], colour) {
  const [ch, sh, cp, sp] = [Math.cos(heading), Math.sin(heading), Math.cos(pitch), Math.sin(pitch)];
  const forward = [cp * ch, cp * sh, sp];
  const right = [sh, -ch, 0];
  const below = [sp * ch, sp * sh, -cp];
  const [cr, sr] = [Math.cos(roll), Math.sin(roll)];
  const depth = 2.5 * run.scene.airframe.span;
  const [x, y] = [Math.tan(across / 2), Math.tan(down / 2)];
  const corners = [[-x, -y], [x, -y], [x, y], [-x, y]].map(([u, v]) =>
    at.map((value, i) => value + depth * (forward[i] + u * (cr * right[i] + sr * below[i]) + v * (cr * below[i] - sr * right[i]))),
  );
  g.strokeStyle = colour;
  g.lineWidth = 1;
  g.globalAlpha = 0.7;
  for (const corner of corners) {
    polyline(g, [at, corner]);
    g.stroke();
  }
  polyline(g, corners, true);
  g.stroke();
  g.globalAlpha = 1;
}

function ray(g, at, seen, colour) {
  polyline(g, [at, seen]);
  g.strokeStyle = colour;
  g.lineWidth = 1;
  g.setLineDash([2, 3]);
  g.stroke();
  g.setLineDash([]);
  const [x, y] = project(seen) ?? [];
  if (x === undefined) return;
  g.beginPath();
  g.arc(x, y, 3, 0, 2 * Math.PI);
  g.fillStyle = colour;
  g.fill();
}
