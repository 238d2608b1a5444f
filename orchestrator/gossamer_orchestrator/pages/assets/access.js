// Pictures without a mouse and without eyes: keys that move them, their tools as one stop of the tab key, their numbers as a table.
const STEPS = { ArrowLeft: [-1, 0, 1], ArrowRight: [1, 0, 1], ArrowUp: [0, 1, 1], ArrowDown: [0, -1, 1], "+": [0, 0, 0.8], "-": [0, 0, 1.25], 0: null };
const MOST_ROWS = 40; // of a table that lists every point

// Of a range, its part moved by tenths and made so much longer about its middle.
function moved([low, high], tenths, longer) {
  const middle = (low + high) / 2 + tenths * (high - low) / 10, half = longer * (high - low) / 2;
  return [middle - half, middle + half];
}

// The place of the eye after a turn about the upright axis and a rise [rad], and so many times as far away.
function turned({ x, y, z }, turn, rise, farther) {
  const around = Math.atan2(y, x) + turn, away = farther * Math.hypot(x, y, z);
  const up = Math.max(-1.5, Math.min(1.5, Math.atan2(z, Math.hypot(x, y)) + rise));
  return { x: away * Math.cos(up) * Math.cos(around), y: away * Math.cos(up) * Math.sin(around), z: away * Math.sin(up) };
}

function steer(figure, event) {
  const step = STEPS[event.key], { div } = figure;
  if (event.target !== div || step === undefined || !figure.drawn || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  const { scene, xaxis, yaxis } = div.layout;
  if (scene) {
    const first = figure.make(theme()).more.scene.camera, camera = scene.camera || first;
    Plotly.relayout(div, { "scene.camera": step ? { ...camera, eye: turned(camera.eye, 0.2 * step[0], 0.2 * step[1], step[2]) } : first });
  } else if (!step) {
    const x = figure.timed ? { "xaxis.range[0]": page.content.start, "xaxis.range[1]": page.content.end } : { "xaxis.autorange": true };
    Plotly.relayout(div, { ...x, "yaxis.autorange": true });
  } else {
    const [x0, x1] = moved(xaxis.range, step[0], step[2]), [y0, y1] = moved(yaxis.range, step[1], step[2]);
    Plotly.relayout(div, { "xaxis.range[0]": x0, "xaxis.range[1]": x1, "yaxis.range[0]": y0, "yaxis.range[1]": y1 });
  }
}

// Readers of the screen get the name of a picture, its tools and its table, not every tick; arrows walk through the tools.
function prepareTools(figure) {
  figure.div.querySelectorAll(".main-svg, .gl-container").forEach((each) => each.setAttribute("aria-hidden", "true"));
  const bar = figure.div.querySelector(".modebar");
  if (!bar) return;
  const tools = Array.from(bar.querySelectorAll("button"));
  bar.setAttribute("aria-label", "Tools of the picture");
  tools.forEach((tool, k) => { tool.tabIndex = k ? -1 : 0; });
  bar.onkeydown = (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key], k = tools.indexOf(document.activeElement);
    if (step && tools[k + step]) tools[k + step].focus();
  };
}

const short = (value) => (typeof value === "number" ? `${Number(value.toPrecision(5))}` : `${value}`);
const isKnown = (value) => typeof value === "number" && Number.isFinite(value);
const textOf = (words) => (words ? words.replace(/<[^>]*>/g, " ").trim() : "");

function addNumbers(figure) {
  const { title } = figure, details = element("details", { class: "numbers" }, element("summary", {}, "Numbers", element("span", { class: "unseen" }, ` of: ${title}`)));
  details.addEventListener("toggle", () => { if (details.open) drawOnce(figure).then(() => fillNumbers(figure)); });
  figure.numbers = details;
  return details;
}

function fillNumbers(figure) {
  if (!figure.numbers.open) return;
  const { head, rows } = numbersOf(figure);
  const cells = (tag, scope, values) => values.map((value) => element(tag, scope ? { scope } : {}, short(value)));
  const table = element("table", {}, element("caption", {}, figure.title), element("thead", {}, element("tr", {}, ...cells("th", "col", head))),
    element("tbody", {}, ...rows.map(([first, ...rest]) => element("tr", {}, ...cells("th", "row", [first]), ...cells("td", "", rest)))));
  figure.numbers.querySelector(".wide")?.remove();
  figure.numbers.append(element("div", { class: "wide" }, table));
}

// Every point of traces that share a few places along x; else of each trace its smallest, its largest and its last value.
function numbersOf({ div, title }) {
  const { xaxis, yaxis } = div.layout, titles = [textOf(xaxis?.title?.text) || "x", textOf(yaxis?.title?.text) || "y"];
  const lying = div.data.some((trace) => trace.orientation === "h"), [x, y] = lying ? titles.reverse() : titles;
  const upright = (trace) => (lying ? { ...trace, x: trace.y, y: trace.x, error_y: trace.error_x } : trace);
  const traces = div.data.map(upright).filter((trace) => trace.visible !== false && valuesOf(trace).some(isKnown));
  const [first] = traces, plain = traces.every((trace) => ["scatter", "bar"].includes(trace.type));
  const places = first ? Array.from(first.x || []) : [];
  const same = (trace) => trace.x.length === places.length && places.every((place, k) => trace.x[k] === place);
  if (plain && places.length <= MOST_ROWS && traces.every(same)) {
    const columns = traces.flatMap(({ y: values, error_y: bars, ...trace }) => [[nameOf(trace) || y, values], ...(bars ? [[bars.arrayminus ? "+" : "±", bars.array]] : []), ...(bars?.arrayminus ? [["-", bars.arrayminus]] : [])]);
    return { head: [x, ...columns.map(([name]) => name)], rows: places.map((place, k) => [place, ...columns.map(([, values]) => (isKnown(values[k]) ? values[k] : "–"))]) };
  }
  const rows = traces.map((trace) => {
    const values = valuesOf(trace), known = values.map((value, k) => k).filter((k) => isKnown(values[k]));
    const extreme = (sign) => known.reduce((best, k) => (sign * values[k] > sign * values[best] ? k : best), known[0]);
    const least = extreme(-1), most = extreme(1), last = known[known.length - 1];
    return [nameOf(trace) || textOf(trace.colorbar?.title?.text) || title, values[least], placeOf(trace, least), values[most], placeOf(trace, most), trace.z || trace.intensity ? "–" : values[last]];
  });
  const at = `at ${x}${traces.some((trace) => trace.z) ? `, ${y}` : ""}`;
  return { head: ["shown", "smallest", at, "largest", at, "last"], rows };
}

// Of an area between two curves, each edge has the name of the area.
function nameOf({ name, line, fill }) {
  return name && line?.width === 0 ? `${name}, ${fill ? "upper" : "lower"} edge` : name;
}

// Words, areas, and lines and dots in space, are marks on what is shown, without a value of their own.
function valuesOf({ type, mode, fill, x, y, z, intensity }) {
  if (type === "scatter3d" || mode === "text" || fill === "toself") return [];
  if (intensity) return Array.from(intensity);
  return z ? z.flatMap((row) => Array.from(row)) : Array.from(y || x || []);
}

function placeOf({ type, x, y, z }, k) {
  if (type === "mesh3d") return "–";
  return z ? `${short(x[k % x.length])}, ${short(y[Math.floor(k / x.length)])}` : x ? x[k] : k;
}
