// What all pictures share: colours of light and dark, a place on the page, the line of the slider's time, linked zoom.
const darkness = matchMedia("(prefers-color-scheme: dark)");
const isNarrow = () => window.innerWidth < 600;
const page = { printing: false, instant: 0, choice: "", content: null, figures: [], linking: false, scripts: {} };

// Colours of Okabe and Ito, which colour-blind readers can tell apart; the lighter ones first on a dark page, on a light one
// darker where a line would have less than 3:1 of contrast.
function theme() {
  const dark = darkness.matches && !page.printing;
  return dark
    ? { dark, ...scales(dark), ink: "#e6eaee", soft: "#a5afba", grid: "#333c46", grey: "#6d7782", panel: "#1c2229",
        lines: ["#56B4E9", "#E69F00", "#3CC79A", "#CC79A7", "#F0E442", "#D55E00"], alarm: "#F08A4B" }
    : { dark, ...scales(dark), ink: "#1b2026", soft: "#59626d", grid: "#dfe4e9", grey: "#84888d", panel: "#f5f7f9",
        lines: ["#0072B2", "#D55E00", "#009E73", "#B5588F", "#8F6B00", "#3D8FBF"], alarm: "#B34700" };
}

// Scales of colours: of damage, where none is the paper's side; of what is no valid judgement, on which the ink can be read; of
// values to both sides of zero, which is the colour of the paper; of taut, wrinkled and slack faces.
function scales(dark) {
  const even = (steps) => steps.map((color, i) => [i / (steps.length - 1), color]);
  return {
    damage: even(dark ? ["#202a35", "#1d4a73", "#2f7fb8", "#7cc0ea", "#e8f5ff"] : ["#f7fbff", "#c6dbef", "#6baed6", "#2171b5", "#08306b"]),
    unsure: even(dark ? ["#1c2229", "#4a535d"] : ["#f5f7f9", "#c3c9cf"]),
    signed: even(dark ? ["#8fd0f5", "#2f7fb8", "#27303a", "#a87416", "#ffd166"] : ["#08519c", "#6baed6", "#f2f2f2", "#e0a93b", "#7f4f00"]),
    marks: [[0, "#56B4E9"], [1 / 3, "#56B4E9"], [1 / 3, "#E69F00"], [2 / 3, "#E69F00"], [2 / 3, "#6d4c7d"], [1, "#6d4c7d"]],
  };
}

function translucent(color, alpha) {
  const parts = [1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16));
  return `rgba(${parts.join(",")},${alpha})`;
}

function element(tag, attributes, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

function heading(text, id) {
  document.getElementById("pictures").append(element("h2", { id }, text));
}

// A figure is drawn anew by `make`, moved to the slider's time by `move`; `timed` figures have time on the x axis, with a
// line at the slider's time; those that are `linked` by the same word are zoomed together.
function addFigure({ title, note, label, make, move, timed, linked, tall, broad, control, slow }) {
  const number = page.figures.length;
  const caption = element("figcaption", {}, element("strong", { id: `caption${number}` }, title));
  if (control) caption.append(control);
  if (note) caption.append(element("small", {}, note));
  const div = element("div", { class: `plot ${tall ? "tall" : broad ? "broad" : ""}`, role: "group", tabindex: "0", "aria-label": label || title });
  const added = { div, title, make, move, timed, linked: timed ? "time" : linked, slow, visible: false, drawing: null, drawn: false, at: -1 };
  div.addEventListener("keydown", (event) => steer(added, event));
  const figure = element("figure", { "aria-labelledby": `caption${number}`, class: broad ? "broad" : "" }, caption, div, addNumbers(added));
  document.getElementById("pictures").append(figure);
  page.figures.push(added);
  return added;
}

// A picture without a neighbour takes the whole row.
function fillRows() {
  let alone = null;
  const broaden = () => { alone?.classList.add("broad"); alone = null; };
  for (const each of document.getElementById("pictures").children) {
    if (each.matches("figure:not(.broad)")) alone = alone ? null : each;
    else broaden();
  }
  broaden();
}

function axis(colors, text, more) {
  return { title: { text, standoff: 8 }, gridcolor: colors.grid, zerolinecolor: colors.grid, linecolor: colors.grid,
           automargin: true, exponentformat: "power", ...more };
}

// The layout of a figure; a timed one begins its shapes with the line at the slider's time.
function layout(figure, colors, more) {
  const base = {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: colors.ink, size: 12, family: "system-ui, sans-serif" },
    margin: { l: 55, r: 12, t: 12, b: 42 }, showlegend: true, legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 },
    hovermode: figure.timed ? "x unified" : "closest", hoverlabel: { bgcolor: colors.panel, font: { color: colors.ink } },
    dragmode: isNarrow() ? false : "zoom", uirevision: "kept",
    modebar: { bgcolor: "rgba(0,0,0,0)", color: colors.soft, activecolor: colors.ink },
  };
  const size = page.printing ? { width: figure.div.clientWidth, height: figure.div.clientHeight } : { autosize: true };
  const made = { ...base, ...more, ...size };
  if (figure.camera) made.scene.camera = figure.camera;
  if (!figure.timed) return made;
  const { start, end, frames } = page.content, time = frames[page.instant];
  const line = { type: "line", xref: "x", yref: "paper", x0: time, x1: time, y0: 0, y1: 1,
                 line: { color: colors.ink, width: 1.2, dash: "dot" } };
  made.shapes = [line, ...(made.shapes || [])];
  made.xaxis = { ...made.xaxis, range: [start, end] };
  return made;
}

async function paint(figure) {
  const colors = theme(), instant = page.instant, { data, more } = figure.make(colors);
  const settings = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"], plotGlPixelRatio: window.devicePixelRatio };
  await Plotly.react(figure.div, data, layout(figure, colors, more), settings);
  if (!figure.drawn && figure.linked) figure.div.on("plotly_relayout", (change) => link(figure, change));
  prepareTools(figure);
  fillNumbers(figure);
  figure.drawn = true;
  figure.at = instant;
  moveFigure(figure);
}

function draw(figure) {
  figure.drawing = paint(figure);
  return figure.drawing;
}

const drawOnce = (figure) => figure.drawing || draw(figure);

// What is not drawn yet will be drawn as things are then.
const drawAnew = (figures) => figures.filter((each) => each.drawing).forEach(draw);

// Zoom in one picture zooms all that are linked with it.
function link(source, change) {
  if (page.linking) return;
  let range = null;
  if ("xaxis.range[0]" in change) range = { "xaxis.range": [change["xaxis.range[0]"], change["xaxis.range[1]"]] };
  else if (change["xaxis.autorange"]) range = source.timed ? { "xaxis.range": [page.content.start, page.content.end] } : { "xaxis.autorange": true };
  if (!range) return;
  page.linking = true;
  const others = page.figures.filter((each) => each.linked === source.linked && each.drawn && each !== source);
  Promise.all(others.map((each) => Plotly.relayout(each.div, range))).finally(() => { page.linking = false; });
}

function moveFigure(figure) {
  if (!figure.drawn || figure.at === page.instant) return;
  figure.at = page.instant;
  const time = page.content.frames && page.content.frames[page.instant];
  if (figure.timed) Plotly.relayout(figure.div, { "shapes[0].x0": time, "shapes[0].x1": time });
  if (figure.move) figure.move(figure.div, page.instant, time);
  fillNumbers(figure);
}

// The place of the last value that holds at a time; -1 before the first.
function lastBefore(times, time) {
  let found = -1;
  for (let k = 0; k < times.length && times[k] <= time + 1e-12; k++) found = k;
  return found;
}
