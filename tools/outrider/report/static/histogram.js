// How long plans took.

let bars = null;

function histogram(spent) {
  const box = html("figure", "chart");
  const caption = html("figcaption", "", "CPU time of a plan, ms ");
  const told = `${spent.plans} plans: p50 ${figure(spent.p50)}, p99 ${figure(spent.p99)}, longest ${figure(spent.longest)} ms`;
  caption.append(html("small", "", told));
  const picture = element("svg", { role: "img", "aria-label": told });
  const values = html("p", "values");
  box.append(caption, picture, values);
  bars = { spent, picture, values, box };
  picture.addEventListener("pointermove", (event) => {
    const area = picture.getBoundingClientRect();
    const x = ((event.clientX - area.left) / area.width) * bars.wide;
    const share = (x - MARGIN.left) / (bars.wide - MARGIN.left - MARGIN.right);
    const bin = Math.floor(share * spent.counts.length);
    if (!(bin in spent.counts)) return;
    const width = spent.most / spent.counts.length;
    const more = bin === spent.counts.length - 1 ? " and more" : ` to ${figure((bin + 1) * width)}`;
    values.textContent = `${figure(bin * width)}${more} ms: ${spent.counts[bin]} plans`;
  });
  return box;
}

function renderBars(wide) {
  bars.wide = wide;
  const { spent, picture } = bars;
  picture.replaceChildren();
  picture.setAttribute("viewBox", `0 0 ${wide} ${TALL}`);
  const vertical = scaleOf(0, Math.max(...spent.counts) * 1.05, 0);
  const base = TALL - MARGIN.bottom;
  const x = (value) => MARGIN.left + (value / spent.most) * (wide - MARGIN.left - MARGIN.right);
  const y = (value) => base - vertical.of(value) * (base - MARGIN.top);
  for (const value of vertical.ticks) {
    picture.append(element("line", { class: "grid", x1: MARGIN.left, x2: wide - MARGIN.right, y1: y(value), y2: y(value) }));
    picture.append(element("text", { x: MARGIN.left - 6, y: y(value) + 4, "text-anchor": "end" }, tick(value)));
  }
  const each = spent.most / spent.counts.length;
  spent.counts.forEach((count, i) => {
    const width = Math.max(0.5, x(each) - x(0) - 1);
    const kind = (i + 1) * each > spent.p99 ? "bar high" : "bar";
    if (count) picture.append(element("rect", { class: kind, x: x(i * each), y: y(count), width, height: base - y(count) }));
  });
  picture.append(element("line", { class: "axis", x1: MARGIN.left, x2: wide - MARGIN.right, y1: base, y2: base }));
  for (const value of steps(0, spent.most, wide / 80)) {
    picture.append(element("text", { x: x(value), y: TALL - 5, "text-anchor": "middle" }, tick(value)));
  }
  // Their values are in the caption: here they would cover bars.
  for (const [name, value] of [["p50", spent.p50], ["p99", spent.p99]]) {
    const mark = element("line", { class: "mark", x1: x(value), x2: x(value), y1: MARGIN.top, y2: base });
    mark.append(element("title", {}, `${name} ${figure(value)} ms`));
    picture.append(mark);
  }
}
