// Scales, ticks and SVG elements.

const SVG = "http://www.w3.org/2000/svg";

function element(name, attributes = {}, text = "") {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text) made.textContent = text;
  return made;
}

function html(name, className = "", text = "") {
  const made = document.createElement(name);
  if (className) made.className = className;
  if (text) made.textContent = text;
  return made;
}

// A short piece of a line in its colour and dashes.
function swatch(k) {
  const svg = element("svg", { viewBox: "0 0 24 10", "aria-hidden": "true" });
  const dashes = dashOf(k).join(" ");
  svg.append(
    element("line", { x1: 0, x2: 24, y1: 5, y2: 5, stroke: colourOf(k), "stroke-width": 4, "stroke-dasharray": dashes }),
  );
  return svg;
}

function steps(low, high, about) {
  const rough = (high - low) / about || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((n) => n * power).find((width) => width >= rough);
  const found = [];
  for (let value = Math.ceil(low / step - 1e-9) * step; value <= high + step * 1e-6; value += step) {
    found.push(Math.abs(value) < step * 1e-6 ? 0 : value);
  }
  return found;
}

// Linear, or linear up to ``bent`` and logarithmic above. from values to 0…1
function scaleOf(low, high, bent) {
  if (!bent) return { of: (value) => (value - low) / (high - low || 1), ticks: steps(low, high, 4) };
  const bend = (value) => (value <= bent ? value / bent : 1 + Math.log10(value / bent));
  const top = bend(Math.max(high, bent * 10));
  const ticks = [0];
  for (let value = bent; bend(value) <= top + 1e-9; value *= 10) ticks.push(value);
  return { of: (value) => bend(Math.max(0, value)) / top, ticks };
}

function figure(value) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  return size >= 100 ? value.toFixed(0) : size >= 10 ? value.toFixed(1) : size >= 0.1 || size === 0 ? value.toFixed(2) : value.toPrecision(2);
}

function tick(value) {
  return String(Number(value.toPrecision(6)));
}
