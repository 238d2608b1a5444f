// Charts that Python describes, in plotly's words, with colours by name.
const VALUES = new Set(["x", "y", "z", "text", "customdata", "array", "arrayminus"]);
const LINE = 27; // of the height of a chart for each name along y [px], axis and legend included

function painted(value, colors, key) {
  if (VALUES.has(key) && value && typeof value === "object" && !value.color) return value;
  if (Array.isArray(value)) return value.map((each) => painted(each, colors));
  if (value && typeof value === "object") return Object.fromEntries(Object.entries(value).map(([name, each]) => [name, painted(each, colors, name)]));
  if (typeof value !== "string" || !value.startsWith("@")) return value;
  const [name, share] = value.slice(1).split("/"), color = colors.lines[name] || colors[name];
  if (name === "over") return inkOn(Number(share), colors);
  return share ? translucent(color, Number(share)) : color;
}

// The colour of words on a map of damage, of so much of its scale: 4.4:1 of contrast or more.
const inkOn = (share, colors) => ((colors.dark ? share < 0.48 : share > 0.7) ? "#ffffff" : "#000000");

// What holds at the slider's time.
const stepOf = (steps) => Math.max(0, lastBefore(steps.time, page.content.frames[page.instant]));

// Words in the lower right corner of a picture.
const inCorner = (text, colors) => ({ text, xref: "paper", yref: "paper", x: 1, y: 0, xanchor: "right", yanchor: "bottom", showarrow: false, bgcolor: translucent(colors.panel, 0.85) });

// Of charts with one title, for instance those of several sensors, the chosen one is drawn.
function addChart(charts) {
  const [first] = charts, moves = charts.some((each) => each.steps), chosen = () => charts.find((each) => each.choice === page.choice) || (charts.length > 1 ? null : first);
  const figure = addFigure({
    title: first.title, note: first.note, label: first.text || first.title, broad: first.broad, tall: first.tall, linked: first.linked,
    timed: first.linked === "time" && Boolean(page.content.frames),
    make(colors) {
      const chart = chosen() || { ...first, traces: [], marks: [], steps: null, result: "" };
      figure.step = chart.steps ? stepOf(chart.steps) : 0;
      const { xaxis, yaxis, ...more } = painted(chart.layout, colors), traces = [...chart.traces, ...(chart.steps?.traces[figure.step] || [])];
      const annotations = chart.result ? [inCorner(chart.result, colors)] : [];
      return { data: traces.map((trace) => painted(trace, colors)), more: { annotations, ...more, shapes: painted(chart.marks, colors), xaxis: axis(colors, chart.x, xaxis), yaxis: axis(colors, chart.y, yaxis) } };
    },
    move: moves && (() => { const chart = chosen(); if (chart?.steps && stepOf(chart.steps) !== figure.step) draw(figure); }),
  });
  const names = first.layout.yaxis?.categoryarray?.length || 0;
  if (names) figure.div.style.height = `${LINE * names}px`; // at least as high as others
  return figure;
}

// Lets the reader choose, for instance a sensor, of which figures are then drawn.
function addPicker(choices, figures) {
  const select = element("select", { id: "choice" });
  choices.forEach((each) => select.append(element("option", { value: each }, each)));
  [page.choice] = choices;
  document.getElementById("pictures").append(element("p", { class: "picker" }, element("label", { for: "choice" }, "Show "), select));
  select.addEventListener("change", () => { page.choice = select.value; drawAnew(figures); });
}

function addPictures() {
  const { charts } = page.content, drawn = new Set();
  let section = "", count = 0;
  for (const chart of charts) {
    if (chart.section !== section) heading(section = chart.section, `section-${++count}`);
    const name = `${chart.section}: ${chart.title}`, same = chart.choice ? charts.filter((each) => each.choice && `${each.section}: ${each.title}` === name) : [chart];
    if (chart.choice && drawn.has(name)) continue;
    if (chart.choice && !page.choice) addPicker([...new Set(charts.map((each) => each.choice).filter(Boolean))], page.chosen = []);
    drawn.add(name);
    const figure = chart.script ? page.scripts[chart.script](chart) : addChart(same);
    if (chart.choice) page.chosen.push(figure);
  }
  page.begin?.();
}
