// A membrane in space: triangles coloured by what its reader chooses; its zones, sensors and wrinkles marked.
const MARKS = ["taut", "wrinkled", "slack"];
const EYE = [-0.5, -0.95, 0.75]; // of the first view: what is drawn on the surface stands a little before it, on this side

// In a narrow window the scale of colours lies above the membrane, not beside it.
const colorbarOf = (more) => ({ ...more, ...(isNarrow() ? { orientation: "h", x: 0.5, y: 1, yanchor: "top", len: 0.85, thickness: 10 } : { thickness: 12, len: 0.75, x: 1.0 }) });

// An axis in space, of small letters, so that its numbers find place beside the membrane.
const placeIn3d = (colors) => ({ gridcolor: colors.grid, zerolinecolor: colors.grid, backgroundcolor: "rgba(0,0,0,0)", tickfont: { size: isNarrow() ? 10 : 11 } });

// Numbers of sensors stand in dots, those of zones in squares: so they can be read on every colour.
const numbered = (symbol, size, fill, ink) => ({ type: "scatter3d", mode: "markers+text", textposition: "middle center", textfont: { size: isNarrow() ? 9 : 11, color: ink },
  marker: { symbol, size: isNarrow() ? 0.8 * size : size, color: fill, line: { color: ink, width: 1 } } });

// What a sensor shows at an instant; its strain is not known before its compensator has stated it.
function sensorText(number, instant) {
  const loop = page.content.charts.find((each) => each.title === "Resistance against strain" && each.choice.split(":")[0] === `${number}`);
  if (!loop) return `sensor ${number}`;
  const [{ x: [strain], y: [resistance] }] = loop.steps.traces[instant];
  return `sensor ${number}<br>strain ${Number.isFinite(strain) ? `${strain.toPrecision(4)} %` : "not known yet"}<br>resistance ${resistance.toPrecision(5)} ohm`;
}

function addSurface(chart) {
  const { content } = page, mesh = content.surface, [I, J, K] = [0, 1, 2].map((k) => mesh.triangles.map((triangle) => triangle[k]));
  const select = element("select", { "aria-label": "Colour of the membrane" });
  for (const { name } of mesh.colours) select.append(element("option", { value: name }, name));
  const colourNamed = (name) => mesh.colours.find((each) => each.name === name);
  const rowOf = (colour, instant) => (colour.time ? Math.max(0, lastBefore(colour.time, content.frames[instant])) : instant);
  const isValid = (colour, instant) => !colour.valid || colour.valid[rowOf(colour, instant)];

  const at = (instant, node, offset = [0, 0, 0]) => [0, 1, 2].map((axis) => mesh.places[instant][3 * node + axis] + offset[axis]);
  let raised = { instant: -1 };
  const normals = (instant) => {
    if (raised.instant === instant) return raised.found;
    const found = new Float32Array(mesh.places[instant].length);
    for (const triangle of mesh.triangles) {
      const [a, b, c] = triangle.map((node) => at(instant, node)), u = b.map((v, k) => v - a[k]), v = c.map((value, k) => value - a[k]);
      const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      for (const node of triangle) for (let k = 0; k < 3; k++) found[3 * node + k] += n[k];
    }
    for (let k = 0; k < found.length; k += 3) {
      const long = Math.hypot(found[k], found[k + 1], found[k + 2]) || 1;
      const side = found[k] * EYE[0] + found[k + 1] * EYE[1] + found[k + 2] * EYE[2] < 0 ? -1 : 1;
      for (let axis = 0; axis < 3; axis++) found[k + axis] *= side / long;
    }
    raised = { instant, found };
    return found;
  };
  const above = (instant, node, height, offset = [0, 0, 0]) => {
    const n = normals(instant);
    return at(instant, node, offset.map((value, axis) => value + height * size * n[3 * node + axis]));
  };
  const points = (found) => ({ x: found.map((p) => p[0]), y: found.map((p) => p[1]), z: found.map((p) => p[2]) });
  const lines = (instant, pairs) => points(pairs.flatMap((node, k) => [above(instant, node, 0.004), ...(k % 2 ? [[null, null, null]] : [])]));
  const outlines = (instant, name) => {
    const colour = colourNamed(name), values = colour && isValid(colour, instant) ? Array.from(colour.values[rowOf(colour, instant)]) : [];
    return lines(instant, values.flatMap((value, zone) => (value >= colour.least ? mesh.borders[zone] : [])));
  };
  const wrinkles = (instant) => {
    const marks = mesh.marked && colourNamed("wrinkles").values[instant];
    const corners = new Map(marks ? mesh.face.map((face, k) => [face, mesh.triangles[k]]).filter(([face]) => marks[face] > 0) : []);
    return points([...corners.values()].map((triangle) => {
      const [a, b, c] = triangle.map((node) => above(instant, node, 0.006));
      return a.map((value, axis) => (value + b[axis] + c[axis]) / 3);
    }));
  };
  const sensors = (instant) => ({ ...points(mesh.sensors.map((node, k) => above(instant, node, 0.04, mesh.offsets[k]))), hovertext: mesh.sensors.map((_, k) => sensorText(k + 1, instant)) });
  const zones = mesh.labels.map((node, zone) => ({ node, offset: mesh.label_offsets[zone], text: `${zone + 1}`, name: `zone ${mesh.names[zone]}` })).filter(({ node }) => node >= 0);
  const skin = (instant) => {
    const colour = colourNamed(select.value), values = colour.values[rowOf(colour, instant)];
    const intensity = colour.of === "node" ? Array.from(values) : mesh.face.map((face) => (colour.of === "face" ? values[face] : values[mesh.zone[face]] || 0));
    return { ...points(Array.from({ length: mesh.places[instant].length / 3 }, (_, node) => at(instant, node))), intensity };
  };
  const look = (colors, instant) => {
    const colour = colourNamed(select.value), { unit } = colour, valid = isValid(colour, instant), bar = unit ? { title: { text: valid ? unit : `${unit}, not valid` } } : { tickvals: [0, 1, 2], ticktext: MARKS };
    return { cmin: colour.ends[0], cmax: colour.ends[1], colorscale: valid ? painted(colour.scale || "Viridis", colors) : colors.unsure, colorbar: colorbarOf(bar) };
  };
  const parts = (instant) => [skin(instant), lines(instant, mesh.borders.flat()), outlines(instant, "estimated damage"), outlines(instant, "true damage"),
    sensors(instant), points(zones.map(({ node, offset }) => above(instant, node, 0.03, offset))), wrinkles(instant), lines(instant, Array.from(mesh.segments))];
  const span = [0, 1, 2].map((axis) => {
    let low = Infinity, high = -Infinity;
    for (const row of mesh.places) for (let k = axis; k < row.length; k += 3) { low = Math.min(low, row[k]); high = Math.max(high, row[k]); }
    return [low, high];
  });
  const size = Math.max(...span.map(([low, high]) => high - low)) || 1;
  const range = (axis) => { const [low, high] = span[axis], room = Math.max(0.05 * (high - low), 0.05 * size); return [low - room, high + room]; };
  const figure = addFigure({
    title: chart.title, note: chart.note, label: chart.text, tall: chart.tall, broad: chart.broad, slow: true, control: select,
    make(colors) {
      const [surface, grid, estimated, real, dots, numbers, crosses, ropes] = parts(page.instant);
      const line = (found, more, name) => ({ type: "scatter3d", mode: "lines", ...found, line: more, name, hoverinfo: "skip", showlegend: Boolean(colourNamed(name)) });
      const named = (trace, name) => ({ ...trace, name });
      const data = [
        { type: "mesh3d", ...surface, i: I, j: J, k: K, intensitymode: colourNamed(select.value).of === "node" ? "vertex" : "cell", ...look(colors, page.instant),
          lighting: { ambient: 0.75, diffuse: 0.5, specular: 0.05 }, hoverinfo: "skip", showscale: true },
        line(grid, { color: colors.dark ? "#cfd6dd" : "#3d4650", width: 2 }, "zones"),
        named(line(estimated, { color: "#D55E00", width: 7 }, "estimated damage"), "judged damaged"),
        named(line(real, { color: colors.dark ? "#ffffff" : "#000000", width: 4, dash: "dash" }, "true damage"), "truly damaged"),
        { ...numbered("circle", 7, "#CC79A7", "#000000"), ...dots, name: "sensors", hoverinfo: "text", text: mesh.sensors.map((_, k) => `${k + 1}`), showlegend: mesh.sensors.length > 0 },
        { ...numbered("square", 6, colors.panel, colors.ink), ...numbers, hoverinfo: "text", showlegend: false, text: zones.map(({ text }) => text), hovertext: zones.map(({ name }) => name) },
        { type: "scatter3d", mode: "markers", ...crosses, name: "wrinkled or slack", hoverinfo: "skip", showlegend: Boolean(mesh.marked), marker: { symbol: "x", size: 3, color: colors.ink } },
        { ...line(ropes, { color: "#0072B2", width: 5 }, "cables and beams"), showlegend: mesh.segments.length > 0 }];
      const one = (axis, name) => ({ ...placeIn3d(colors), title: { text: `${name} [${mesh.unit}]`, font: { size: 12 } }, range: range(axis), nticks: isNarrow() || range(axis)[1] - range(axis)[0] < 0.4 * size ? 3 : 5 });
      const [x, y, z] = [0, 1, 2].map((axis) => { const [low, high] = range(axis); return 1.5 * (high - low) / size; });
      const camera = isNarrow() ? { eye: { x: -1.2, y: -2.7, z: 2 }, center: { x: -0.15, y: 0, z: -0.2 } } : { eye: { x: -1.05, y: -2, z: 1.55 }, center: { x: -0.1, y: 0, z: -0.25 } };
      const scene = { xaxis: one(0, "x"), yaxis: one(1, "y"), zaxis: one(2, "z"), aspectmode: "manual", aspectratio: { x, y, z }, camera };
      return { data, more: { scene, margin: { l: 0, r: 0, t: 0, b: 0 }, legend: { orientation: "h", y: 0, x: 0 } } };
    },
    move(div, instant) {
      const found = parts(instant), same = Array(7).fill(undefined), { colorscale, colorbar } = look(theme(), instant);
      Plotly.restyle(div, {
        x: found.map((f) => f.x), y: found.map((f) => f.y), z: found.map((f) => f.z), hovertext: found.map((f) => f.hovertext),
        intensity: [found[0].intensity, ...same], colorscale: [colorscale, ...same], ...(colorbar.title ? { "colorbar.title.text": [colorbar.title.text, ...same] } : {}),
      });
    },
  });
  select.addEventListener("change", () => draw(figure));
  return figure;
}

page.scripts.addSurface = addSurface;
