// The one time that the replay and all charts show, and the part of the flight that they span.

const cursor = { time: 0, from: 0, to: 1, playing: false, speed: 1, hidden: new Set() };
const watchers = [];

// Calls back after every change: what is one of "time", "range", "vehicles", "playing".
function watch(callback) {
  watchers.push(callback);
}

function tell(what) {
  for (const callback of watchers) callback(what);
}

function moveTo(time) {
  cursor.time = Math.min(Math.max(time, cursor.from), cursor.to);
  tell("time");
}

function span(from, to) {
  cursor.from = from;
  cursor.to = Math.max(to, from + 0.1);
  cursor.time = Math.min(Math.max(cursor.time, cursor.from), cursor.to);
  tell("range");
}

function toggleVehicle(k) {
  if (!cursor.hidden.delete(k)) cursor.hidden.add(k);
  tell("vehicles");
}

function play(on) {
  if (on === cursor.playing) return;
  cursor.playing = on;
  tell("playing");
  if (!on) return;
  if (cursor.time >= cursor.to - 1e-6) moveTo(cursor.from);
  let last = performance.now();
  const step = (now) => {
    if (!cursor.playing) return;
    moveTo(cursor.time + (Math.max(0, now - last) / 1000) * cursor.speed);
    last = now;
    if (cursor.time >= cursor.to) play(false);
    else requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
}
