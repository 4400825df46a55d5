// The vehicles of the scene: where they were, where they are, and what they follow.

const CHUNK = 6;

// Paths in pieces, so that each piece can be before or behind something.
function trails(g, add, time) {
  if (!show.trail) return;
  const whole = show.trail > 1e6;
  const from = whole ? cursor.from : Math.max(cursor.from, time - show.trail);
  const last = place(time).index;
  const until = whole ? place(cursor.to).index : last;
  const first = place(from).next;
  const step = Math.max(1, Math.round((until - first) / 500));
  for (let begin = first; begin < until; begin += CHUNK * step) {
    const future = begin > last && show.trail < Infinity;
    for (let k = -1; k < flight.systems.length; k++) {
      if (cursor.hidden.has(k)) continue;
      const points = [];
      for (let i = begin; i <= Math.min(begin + CHUNK * step, until); i += step) {
        points.push(vector(k < 0 ? flight.target : flight.position, Math.max(k, 0), { index: i, next: i, share: 0 }));
      }
      add(points.find(Boolean), () => piece(g, points, k, future ? 0.28 : 0.85));
    }
  }
}

function piece(g, points, k, alpha) {
  polyline(g, points);
  g.globalAlpha = alpha;
  g.strokeStyle = k < 0 ? ink.target : colourOf(k);
  g.lineWidth = k < 0 ? 1.4 : 2;
  g.setLineDash(k < 0 ? [2, 4] : dashOf(k));
  g.stroke();
  g.setLineDash([]);
  g.globalAlpha = 1;
}

// What is on the ground is drawn before all that is not hidden behind the same boxes.
const BELOW = -1e9;

function vehicle(g, add, at, k, here, time) {
  const colour = colourOf(k);
  const { airframe, dMin } = run.scene;
  const foot = [at[0], at[1], 0];
  add(foot, () => shadow(g, at, 0.5 * airframe.span), BELOW);
  add(foot, () => stem(g, at, colour), BELOW);
  if (show.spheres && dMin) add(at, () => ball(g, at, 0.5 * dMin, colour, colour, 0.1), -0.01);
  const reference = show.references && vector(flight.reference, k, here);
  if (reference) add(reference, () => followed(g, at, reference, colour));
  add(at, () => multirotor(g, at, attitude(k, time), colour, time), 0.01);
}

// A small diamond, and a line to it.
function followed(g, at, reference, colour) {
  polyline(g, [at, reference]);
  g.strokeStyle = colour;
  g.lineWidth = 1;
  g.stroke();
  const seen = project(reference);
  if (!seen) return;
  g.beginPath();
  for (const [dx, dy] of [[0, -4], [4, 0], [0, 4], [-4, 0]]) g.lineTo(seen[0] + dx, seen[1] + dy);
  g.closePath();
  g.fillStyle = ink.paper;
  g.fill();
  g.stroke();
}

function nearest(g, add, places, { distance, who }) {
  const [a, b] = who.map((k) => places[k]);
  if (!a || !b) return;
  const near = run.scene.dMin && distance < run.scene.dMin;
  const middle = a.map((value, i) => (value + b[i]) / 2);
  add(middle, () => {
    polyline(g, [a, b]);
    g.strokeStyle = near ? ink.bad : ink.soft;
    g.lineWidth = near ? 2.5 : 1.2;
    g.setLineDash([4, 4]);
    g.stroke();
    g.setLineDash([]);
  });
}
