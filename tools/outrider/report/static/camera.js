// A camera that looks at a point from a bearing, a height and a distance. World: east, north, up, m.

const camera = { azimuth: -1.15, elevation: 0.62, distance: 30, centre: [0, 0, 3], width: 1, height: 1, flat: false };
const NEAR = 0.2;
const FIELD = 0.9;

// The axes of the picture in the world; worked out once for each picture.
function aim() {
  const { azimuth, elevation, distance, centre } = camera;
  const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
  camera.back = [ce * ca, ce * sa, se];
  camera.right = [-sa, ca, 0];
  camera.up = [-se * ca, -se * sa, ce];
  camera.eye = centre.map((c, i) => c + distance * camera.back[i]);
  camera.focus = Math.min(camera.width, camera.height * 1.35) / FIELD;
}

function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Pixels for a metre at a depth: without perspective the same everywhere.
function pixelsPerMetre(depth) {
  return camera.focus / (camera.flat ? camera.distance : depth);
}

// Where a point is in the picture: [x, y, depth]; null behind the eye.
function project(point) {
  const off = [point[0] - camera.eye[0], point[1] - camera.eye[1], point[2] - camera.eye[2]];
  const depth = -dot(off, camera.back);
  if (depth < NEAR && !camera.flat) return null;
  const scale = pixelsPerMetre(depth);
  return [
    camera.width / 2 + dot(off, camera.right) * scale,
    camera.height / 2 - dot(off, camera.up) * scale,
    depth,
  ];
}

function orbit(dx, dy) {
  camera.azimuth -= dx;
  camera.elevation = Math.min(Math.max(camera.elevation + dy, -0.1), Math.PI / 2);
}

// By pixels of the picture, so that what is in the middle stays under the finger.
function pan(dx, dy) {
  const metres = camera.distance / camera.focus;
  for (let i = 0; i < 3; i++) camera.centre[i] += (-dx * camera.right[i] + dy * camera.up[i]) * metres;
}

function zoom(factor) {
  camera.distance = Math.min(Math.max(camera.distance * factor, 1), 2000);
}

// The smallest rectangle of the picture that holds all points; null if one is behind the eye.
function frame(points) {
  aim();
  const found = { left: Infinity, right: -Infinity, top: Infinity, bottom: -Infinity };
  for (const point of points) {
    const seen = project(point);
    if (!seen) return null;
    found.left = Math.min(found.left, seen[0]);
    found.right = Math.max(found.right, seen[0]);
    found.top = Math.min(found.top, seen[1]);
    found.bottom = Math.max(found.bottom, seen[1]);
  }
  return found;
}

// Room for the numbers beside the ground and for names above vehicles, pixels.
const ROOM = { across: 100, above: 34, below: 30 };

// As near as can be with all points in the picture, and in its middle.
function fit(points) {
  const low = [0, 1, 2].map((i) => points.reduce((least, point) => Math.min(least, point[i]), Infinity));
  const high = [0, 1, 2].map((i) => points.reduce((most, point) => Math.max(most, point[i]), -Infinity));
  camera.centre = low.map((value, i) => (value + high[i]) / 2);
  camera.distance = 1.5 * Math.max(1, Math.hypot(...low.map((value, i) => high[i] - value)));
  const [width, height] = [camera.width - ROOM.across, camera.height - ROOM.above - ROOM.below];
  for (let round = 0; round < 60; round++) {
    const seen = frame(points);
    if (!seen) {
      zoom(1.3);
      continue;
    }
    const size = Math.max((seen.right - seen.left) / width, (seen.bottom - seen.top) / height);
    pan(camera.width / 2 - (seen.left + seen.right) / 2, ROOM.above + height / 2 - (seen.top + seen.bottom) / 2);
    // Step by step: near points grow faster than they come nearer.
    zoom(Math.min(Math.max(size, 0.9), 1.1));
  }
  aim();
}
