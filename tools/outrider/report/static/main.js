// Puts the page together, and paper in the place of the screen.

const PAPER = 430;
const $ = (id) => document.getElementById(id);

function start() {
  mix();
  bounds = extent(run.from, run.to);
  Object.assign(cursor, { from: run.from, to: run.to, time: Math.max(run.from, Math.min(0, run.to)) });
  for (const one of run.charts) $("charts").append(chart(one));
  if (run.spent) $("charts").append(histogram(run.spent));
  vehicleButtons();
  $("sighted").hidden = !run.cameras;
  controls();
  watch(changed);
  resize();
  home();
  renderAll();
  changed("time");
  new ResizeObserver(() => {
    resize();
    renderAll();
  }).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", relight);
  window.addEventListener("beforeprint", ontoPaper);
  window.addEventListener("afterprint", offPaper);
  window.addEventListener("hashchange", byAddress);
  byAddress();
}

// report.html#3.2 opens at 3.2 s.
function byAddress() {
  const time = Number.parseFloat(location.hash.slice(1));
  if (Number.isFinite(time)) goTo(time);
}

function relight() {
  mix();
  vehicleButtons();
  renderAll();
  redraw();
}

function renderAll(wide = 0) {
  for (const made of drawn) render(made, wide || made.box.clientWidth || PAPER);
  if (bars) renderBars(wide || bars.box.clientWidth || PAPER);
}

function vehicleButtons() {
  $("vehicles").replaceChildren();
  flight.systems.forEach((system, k) => {
    const button = html("button", "", "");
    button.type = "button";
    button.title = "show or hide this vehicle everywhere";
    button.append(swatch(k), String(system));
    if (stranger(k)) button.append(" (bystander)");
    button.setAttribute("aria-pressed", String(!cursor.hidden.has(k)));
    button.addEventListener("click", () => {
      toggleVehicle(k);
      button.setAttribute("aria-pressed", String(!cursor.hidden.has(k)));
    });
    $("vehicles").append(button);
  });
}

function controls() {
  const slider = $("slider");
  slider.step = "any";
  slider.addEventListener("input", () => {
    play(false);
    moveTo(Number(slider.value));
  });
  $("play").addEventListener("click", () => play(!cursor.playing));
  $("speed").addEventListener("change", (event) => (cursor.speed = Number(event.target.value)));
  $("trail").addEventListener("change", (event) => {
    show.trail = Number(event.target.value);
    redraw();
  });
  $("range").addEventListener("change", (event) => {
    if (event.target.value === "all") span(flight.time[0], flight.time[flight.time.length - 1]);
    else span(run.from, run.to);
  });
  for (const name of ["spheres", "references", "ids", "cameras"]) {
    $(name).addEventListener("change", (event) => {
      show[name] = event.target.checked;
      redraw();
    });
  }
  $("home").addEventListener("click", home);
  $("top").addEventListener("click", fromAbove);
  $("chase").addEventListener("click", () => chase(!chasing));
  for (const button of document.querySelectorAll("button[data-time]")) {
    button.addEventListener("click", () => goTo(Number(button.dataset.time)));
  }
}

// To an event, be it before the goal event or after the clock.
function goTo(time) {
  play(false);
  if (time < cursor.from || time > cursor.to) {
    $("range").value = "all";
    span(flight.time[0], flight.time[flight.time.length - 1]);
  }
  moveTo(time);
  $("view").scrollIntoView({ block: "nearest" });
}

function changed(what) {
  if (what === "range" || what === "vehicles") renderAll();
  const slider = $("slider");
  [slider.min, slider.max, slider.value] = [cursor.from, cursor.to, cursor.time];
  $("clock").textContent = `${cursor.time.toFixed(2)} s`;
  $("play").textContent = cursor.playing ? "❚❚" : "▶";
  for (const made of drawn) follow(made);
  redraw();
}

// A still of all paths in the light of paper; charts at a width that two of them share.
let before = null;

function ontoPaper() {
  if (before) return;
  before = { trail: show.trail };
  play(false);
  show.trail = Infinity;
  document.documentElement.dataset.print = "";
  mix();
  vehicleButtons();
  resize(3);
  draw();
  renderAll(PAPER);
}

function offPaper() {
  if (!before) return;
  show.trail = before.trail;
  before = null;
  delete document.documentElement.dataset.print;
  resize();
  relight();
}

if (run) start();
