// A camera that looks at a point from a bearing, a height and a distance. World: east, north, up, m.

const camera = { azimuth: -1.15, elevation: 0.62, distance: 30, centre: [0, 0, 3], width: 1, height: 1 };
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

// Where a point is in the picture: [x, y, depth]; null behind the eye.
function project(point) {
  const off = [point[0] - camera.eye[0], point[1] - camera.eye[1], point[2] - camera.eye[2]];
  const depth = -dot(off, camera.back);
  if (depth < NEAR) return null;
  const scale = camera.focus / depth;
  return [
    camera.width / 2 + dot(off, camera.right) * scale,
    camera.height / 2 - dot(off, camera.up) * scale,
    depth,
  ];
}

function orbit(dx, dy) {
  camera.azimuth -= dx;
  camera.elevation = Math.min(Math.max(camera.elevation + dy, -0.1), Math.PI / 2 - 1e-3);
}

// By pixels of the picture, so that what is in the middle stays under the finger.
function pan(dx, dy) {
  const metres = camera.distance / camera.focus;
  for (let i = 0; i < 3; i++) camera.centre[i] += (-dx * camera.right[i] + dy * camera.up[i]) * metres;
}

function zoom(factor) {
  camera.distance = Math.min(Math.max(camera.distance * factor, 1), 2000);
}

// The smallest rectangle of the picture that holds the corners of a box; null if one is behind the eye.
function frame(low, high) {
  aim();
  const found = { left: Infinity, right: -Infinity, top: Infinity, bottom: -Infinity };
  for (let corner = 0; corner < 8; corner++) {
    const seen = project([0, 1, 2].map((i) => ((corner >> i) & 1 ? high[i] : low[i])));
    if (!seen) return null;
    found.left = Math.min(found.left, seen[0]);
    found.right = Math.max(found.right, seen[0]);
    found.top = Math.min(found.top, seen[1]);
    found.bottom = Math.max(found.bottom, seen[1]);
  }
  return found;
}

// As near as can be with all of a box in the picture, and in its middle.
function fit(low, high) {
  camera.centre = low.map((value, i) => (value + high[i]) / 2);
  camera.distance = 1.5 * Math.hypot(...low.map((value, i) => high[i] - value));
  for (let round = 0; round < 60; round++) {
    const seen = frame(low, high);
    if (!seen) {
      zoom(1.3);
      continue;
    }
    const wide = (seen.right - seen.left) / (camera.width - 84);
    const tall = (seen.bottom - seen.top) / (camera.height - 90);
    pan(camera.width / 2 - (seen.left + seen.right) / 2, camera.height / 2 - 8 - (seen.top + seen.bottom) / 2);
    // Step by step: near corners grow faster than the box comes nearer.
    zoom(Math.min(Math.max(wide, tall, 0.9), 1.1));
  }
  aim();
}
