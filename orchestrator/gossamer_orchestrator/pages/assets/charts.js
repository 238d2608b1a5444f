// Charts that Python describes, traces and layout of plotly, with colours by name.
const VALUES = new Set(["x", "y", "z", "text", "customdata", "array", "arrayminus"]);
const LINE = 27; // of the height of a chart for each name along y [px], axis and legend included

function painted(value, colors, key) {
  if (VALUES.has(key) && value && typeof value === "object" && !value.color) return value;
  if (Array.isArray(value)) return value.map((each) => painted(each, colors));
  if (value && typeof value === "object") return Object.fromEntries(Object.entries(value).map(([name, each]) => [name, painted(each, colors, name)]));
  if (typeof value !== "string" || !value.startsWith("@")) return value;
  const [name, share] = value.slice(1).split("/"), color = colors.lines[name] || colors[name];
  return share ? translucent(color, Number(share)) : color;
}

function addPictures() {
  let section = "";
  for (const chart of page.content.charts) {
    if (chart.section !== section) heading(section = chart.section);
    const { xaxis, yaxis, ...more } = chart.layout;
    const { div } = addFigure({
      title: chart.title, note: chart.note, label: chart.text || chart.title, broad: chart.broad, tall: chart.tall, linked: chart.linked,
      make: (colors) => ({
        data: chart.traces.map((trace) => painted(trace, colors)),
        more: { ...painted(more, colors), xaxis: axis(colors, chart.x, xaxis), yaxis: axis(colors, chart.y, yaxis) },
      }),
    });
    const names = yaxis?.categoryarray?.length || 0;
    if (names) div.style.height = `${LINE * names}px`; // at least as high as others
  }
}
