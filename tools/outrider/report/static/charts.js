// Charts over time: all share the cursor, and a finger or the mouse in one of them moves it.

const MARGIN = { left: 44, right: 12, top: 8, bottom: 20 };
const TALL = 168;
const drawn = [];

function chart(specification) {
  const box = html("figure", "chart");
  const caption = html("figcaption", "", `${specification.title}, ${specification.unit} `);
  caption.append(html("small", "", specification.note));
  caption.append(...specification.levels.map((level) => levelName(level, specification.unit)));
  const picture = element("svg", { role: "img", "aria-label": specification.title });
  const values = html("p", "values");
  box.append(caption, picture, values);
  const times = specification.time ? decode(specification.time).values : flight.time;
  const made = { ...specification, times, values: decode(specification.values), box, picture, told: values };
  made.row = made.lines.length;
  picture.addEventListener("pointerdown", (event) => {
    picture.setPointerCapture(event.pointerId);
    seek(made, event);
  });
  picture.addEventListener("pointermove", (event) => event.buttons && seek(made, event));
  picture.addEventListener("pointermove", (event) => tellAt(made, timeAt(made, event)));
  picture.addEventListener("pointerleave", () => tellAt(made, cursor.time));
  drawn.push(made);
  return box;
}

// A limit beside its dashes: in the picture its name would cover data.
function levelName({ name, value }, unit) {
  const named = html("span", "named");
  const svg = element("svg", { viewBox: "0 0 24 10", "aria-hidden": "true" });
  svg.append(element("line", { class: levelClass(name), x1: 0, x2: 24, y1: 5, y2: 5 }));
  named.append(svg, `${name} ${tick(value)} ${unit}`);
  return named;
}

function levelClass(name) {
  return name === "d_min" ? "level" : "level dim";
}

function timeAt(made, event) {
  const box = made.picture.getBoundingClientRect();
  const x = ((event.clientX - box.left) / box.width) * made.wide;
  const share = (x - MARGIN.left) / (made.wide - MARGIN.left - MARGIN.right);
  return cursor.from + Math.min(Math.max(share, 0), 1) * (cursor.to - cursor.from);
}

function seek(made, event) {
  play(false);
  moveTo(timeAt(made, event));
}

// The vehicle of a line: its index, or that of the line itself where it is of all.
function lineIndex(made, j) {
  const { system } = made.lines[j];
  return system === null ? j : flight.systems.indexOf(system);
}

function visible(made, j) {
  return made.lines[j].system === null || !cursor.hidden.has(lineIndex(made, j));
}

function render(made, wide) {
  made.wide = wide;
  const { picture } = made;
  picture.replaceChildren();
  picture.setAttribute("viewBox", `0 0 ${wide} ${TALL}`);
  const first = place(cursor.from, made.times).index;
  const last = place(cursor.to, made.times).next;
  let high = 0;
  for (const one of made.levels) high = Math.max(high, one.value * 1.05);
  for (let i = first; i <= last; i++) {
    for (let j = 0; j < made.row; j++) {
      const value = made.values.values[i * made.row + j];
      if (visible(made, j) && value > high) high = value;
    }
  }
  const vertical = scaleOf(0, high * 1.04 || 1, made.bent);
  const x = (time) => MARGIN.left + ((time - cursor.from) / (cursor.to - cursor.from)) * (wide - MARGIN.left - MARGIN.right);
  const y = (value) => TALL - MARGIN.bottom - vertical.of(value) * (TALL - MARGIN.top - MARGIN.bottom);
  made.x = x;
  bands(picture, x);
  for (const value of vertical.ticks) {
    picture.append(element("line", { class: "grid", x1: MARGIN.left, x2: wide - MARGIN.right, y1: y(value), y2: y(value) }));
    picture.append(element("text", { x: MARGIN.left - 6, y: y(value) + 4, "text-anchor": "end" }, tick(value)));
  }
  const base = TALL - MARGIN.bottom;
  picture.append(element("line", { class: "axis", x1: MARGIN.left, x2: wide - MARGIN.right, y1: base, y2: base }));
  const times = steps(cursor.from, cursor.to, wide / 80);
  times.forEach((time, i) => {
    const label = i === times.length - 1 ? `${tick(time)} s` : tick(time);
    picture.append(element("text", { x: x(time), y: TALL - 5, "text-anchor": "middle" }, label));
  });
  for (let j = 0; j < made.row; j++) {
    if (!visible(made, j)) continue;
    const k = lineIndex(made, j);
    const path = outline(made, j, first, last, x, y);
    const dashes = dashOf(k).join(" ");
    picture.append(element("path", { class: "line", d: path, stroke: colourOf(k), "stroke-dasharray": dashes }));
  }
  for (const { name, value } of made.levels) {
    const at = { x1: MARGIN.left, x2: wide - MARGIN.right, y1: y(value), y2: y(value) };
    picture.append(element("line", { class: levelClass(name), ...at }));
  }
  made.line = element("line", { class: "cursor", y1: MARGIN.top, y2: base });
  picture.append(made.line);
  follow(made);
}

// A path; of several samples in one column of the picture the least and the most are drawn.
function outline(made, j, first, last, x, y) {
  const parts = [];
  let down = false;
  const every = Math.max(1, Math.floor((last - first) / (2 * made.wide)));
  for (let i = first; i <= last; i += every) {
    let found = [];
    for (let n = i; n < Math.min(i + every, last + 1); n++) {
      const value = made.values.values[n * made.row + j];
      if (!Number.isNaN(value)) found.push([made.times[n], value]);
    }
    if (found.length > 2) {
      const sorted = [...found].sort((a, b) => a[1] - b[1]);
      found = [sorted[0], sorted[sorted.length - 1]].sort((a, b) => a[0] - b[0]);
    }
    if (!found.length) down = false;
    for (const [time, value] of found) {
      parts.push(`${down ? "L" : "M"}${x(time).toFixed(1)} ${y(value).toFixed(1)}`);
      down = true;
    }
  }
  return parts.join("");
}

// What lasts is shaded, what happens at once is a line.
function bands(picture, x) {
  for (const { time, until, kind, text, bad } of run.events) {
    if (time > cursor.to || (until ?? time) < cursor.from) continue;
    const tall = TALL - MARGIN.top - MARGIN.bottom;
    const left = x(Math.max(time, cursor.from));
    const shape =
      until === null
        ? element("line", { class: "mark", x1: left, x2: left, y1: MARGIN.top, y2: MARGIN.top + tall })
        : element("rect", {
            class: bad ? "band bad" : "band",
            x: left,
            y: MARGIN.top,
            width: Math.max(1.5, x(Math.min(until, cursor.to)) - left),
            height: tall,
          });
    shape.append(element("title", {}, `${kind}: ${text}`));
    picture.append(shape);
  }
}

function follow(made) {
  if (!made.line) return;
  const at = made.x(cursor.time).toFixed(1);
  made.line.setAttribute("x1", at);
  made.line.setAttribute("x2", at);
  tellAt(made, cursor.time);
}

// A separation has the two decimals that it has in the scene.
function shown(made, value) {
  return made.key === "separation" && Number.isFinite(value) ? value.toFixed(2) : figure(value);
}

function tellAt(made, time) {
  const { index, next, share } = place(time, made.times);
  const parts = made.lines.map((line, j) => {
    const value = made.values.values[(share < 0.5 ? index : next) * made.row + j];
    const part = html("span");
    part.append(swatch(lineIndex(made, j)), `${line.name} ${shown(made, value)}`);
    part.hidden = !visible(made, j);
    return part;
  });
  made.told.replaceChildren(...parts);
}
