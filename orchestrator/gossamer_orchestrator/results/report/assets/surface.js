// A membrane on a mesh: triangles in space, coloured by deflection, strain, wrinkles or damage; its zones, sensors and wrinkles marked.
const MARKS = ["taut", "wrinkled", "slack"];

function largest(rows) {
  let top = 0;
  for (const row of rows) for (const value of row) if (value > top) top = value;
  return top;
}

function bottom(rows) {
  return rows.reduce((least, row) => row.reduce((a, b) => Math.min(a, b), least), Infinity);
}

function addSurface() {
  const { content } = page, damage = content.damage, mesh = content.surface;
  const columns = (k) => mesh.triangles.map((triangle) => triangle[k]);
  const [I, J, K] = [0, 1, 2].map(columns);
  const topStrain = largest(mesh.strain), topAway = 1e3 * largest(mesh.deflection) || 1;
  const marks = mesh.mark.some((row) => row.some((value) => value > 0));
  const choices = [["deflection", "deflection"], ["strain", "largest strain"], ["mark", "wrinkles"]];
  if (mesh.zones && damage && damage.windows) choices.push(["estimated", "estimated damage"]);
  if (mesh.zones && damage && damage.true) choices.push(["true", "true damage"]);
  const select = element("select", { "aria-label": "Colour of the membrane" });
  for (const [value, text] of choices) select.append(element("option", { value }, text));

  const at = (instant, node, offset = [0, 0, 0]) => [0, 1, 2].map((axis) => mesh.places[instant][3 * node + axis] + offset[axis]);
  // What is drawn on the surface stands a little before it, on the side of the first view.
  const eye = [-0.5, -0.95, 0.75];
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
      const side = found[k] * eye[0] + found[k + 1] * eye[1] + found[k + 2] * eye[2] < 0 ? -1 : 1;
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
  const lines = (instant, pairs) => {
    const found = [];
    for (let k = 0; k < pairs.length; k += 2) found.push(above(instant, pairs[k], 0.004), above(instant, pairs[k + 1], 0.004), [null, null, null]);
    return points(found);
  };
  const all = mesh.borders.flat();
  const outlines = (instant, values, least) =>
    lines(instant, values ? Array.from(values.keys()).filter((z) => z < mesh.zones && values[z] >= least).flatMap((z) => mesh.borders[z]) : []);
  const wrinkles = (instant) => {
    const found = [], seen = new Set();
    mesh.triangles.forEach((triangle, k) => {
      if (mesh.mark[instant][mesh.face[k]] > 0 && !seen.has(mesh.face[k])) {
        seen.add(mesh.face[k]);
        const [a, b, c] = triangle.map((node) => above(instant, node, 0.006));
        found.push(a.map((value, axis) => (value + b[axis] + c[axis]) / 3));
      }
    });
    return points(found);
  };
  const sensors = (instant) => ({
    ...points(mesh.sensors.map((node, k) => above(instant, node, 0.04, mesh.offsets[k]))),
    hovertext: mesh.sensors.map((_, k) => sensorText(k + 1, instant)),
  });
  const zones = mesh.labels.map((node, zone) => ({ node, offset: mesh.label_offsets[zone], text: `${zone + 1}` })).filter(({ node }) => node >= 0);
  const labels = (instant) => points(zones.map(({ node, offset }) => above(instant, node, 0.03, offset)));
  const skin = (instant) => points(Array.from({ length: mesh.places[instant].length / 3 }, (_, node) => at(instant, node)));
  const intensity = (instant) => {
    if (select.value === "deflection") return Array.from(mesh.deflection[instant], (value) => 1e3 * value);
    if (select.value === "strain") return mesh.face.map((face) => mesh.strain[instant][face]);
    if (select.value === "mark") return mesh.face.map((face) => mesh.mark[instant][face]);
    const values = select.value === "true" ? trueAt(content.frames[instant]) : estimatedAt(content.frames[instant]);
    return mesh.face.map((face) => (values && mesh.zone[face] >= 0 ? 100 * values[mesh.zone[face]] : 0));
  };
  const damageColours = (instant) => coloursOf(select.value, content.frames[instant]);
  const colouring = (colors) => ({
    deflection: { cmin: 0, cmax: topAway, colorscale: "Viridis", colorbar: { title: { text: "mm" } } },
    strain: { cmin: bottom(mesh.strain), cmax: topStrain || 1, colorscale: "Cividis", colorbar: { title: { text: "strain" } } },
    mark: { cmin: -0.5, cmax: 2.5, colorscale: [[0, "#56B4E9"], [1 / 3, "#56B4E9"], [1 / 3, "#E69F00"], [2 / 3, "#E69F00"], [2 / 3, "#6d4c7d"], [1, "#6d4c7d"]],
            colorbar: { tickvals: [0, 1, 2], ticktext: MARKS } },
    estimated: { cmin: 0, cmax: damage ? topDamage() : 1, colorscale: damageColours(page.instant).colorscale, colorbar: { title: { text: damageColours(page.instant).unit } } },
    true: { cmin: 0, cmax: damage ? topDamage() : 1, colorscale: damageScale(colors), colorbar: { title: { text: "%" } } },
  }[select.value]);
  const parts = (instant) => {
    const time = content.frames[instant];
    return [skin(instant), lines(instant, all), outlines(instant, damage && judgedAt(time), leastFound()),
            outlines(instant, damage && trueAt(time), 1e-9), sensors(instant), wrinkles(instant), labels(instant)];
  };
  const span = [0, 1, 2].map((axis) => {
    let low = Infinity, high = -Infinity;
    for (const row of mesh.places) for (let k = axis; k < row.length; k += 3) { low = Math.min(low, row[k]); high = Math.max(high, row[k]); }
    return [low, high];
  });
  const size = Math.max(...span.map(([low, high]) => high - low)) || 1;
  const figure = addFigure({
    title: "Membrane", tall: true, broad: !page.content.square, slow: true, control: select,
    note: (mesh.factor === 1 ? "Drawn to scale." : `Displacements are drawn ${mesh.factor} times as large; the axes hold for the membrane at rest.`) + " Drag to turn; squares are zones, dots sensors"
      + (marks ? ", crosses faces that wrinkle or are slack." : "; no face wrinkles."),
    label: "The membrane in three dimensions, with zones, sensors, wrinkles and damaged zones marked; the tables below hold the numbers.",
    make(colors) {
      const [surface, grid, estimated, real, dots, crosses, numbers] = parts(page.instant), { colorbar, ...colour } = colouring(colors);
      const line = (found, more, name) => ({ type: "scatter3d", mode: "lines", ...found, line: more, name, hoverinfo: "skip" });
      const data = [
        { type: "mesh3d", ...surface, i: I, j: J, k: K, intensity: intensity(page.instant), intensitymode: select.value === "deflection" ? "vertex" : "cell",
          ...colour, colorbar: colorbarOf(colorbar), lighting: { ambient: 0.75, diffuse: 0.5, specular: 0.05 }, hoverinfo: "skip", showscale: true },
        { ...line(grid, { color: colors.dark ? "#cfd6dd" : "#3d4650", width: 2 }, "zones"), showlegend: false },
        { ...line(estimated, { color: "#D55E00", width: 7 }, "judged damaged"), showlegend: Boolean(damage && damage.windows) },
        { ...line(real, { color: colors.dark ? "#ffffff" : "#000000", width: 4, dash: "dash" }, "truly damaged"), showlegend: Boolean(damage && damage.true) },
        { ...sensorDots(), ...dots, text: upTo(mesh.sensors.length), showlegend: mesh.sensors.length > 0 },
        { type: "scatter3d", mode: "markers", ...crosses, name: "wrinkled or slack", hoverinfo: "skip", showlegend: marks, marker: { symbol: "x", size: 3, color: colors.ink } },
        { ...zoneSquares(colors), ...numbers, text: zones.map(({ text }) => text) }];
      const place = placeIn3d(colors);
      const range = (axis) => { const [low, high] = span[axis], room = Math.max(0.05 * (high - low), 0.05 * size); return [low - room, high + room]; };
      const one = (axis, name) => ({ ...place, title: { ...place.title, text: `${name} [m]` }, range: range(axis), nticks: isNarrow() || range(axis)[1] - range(axis)[0] < 0.4 * size ? 3 : 5 });
      const ratio = [0, 1, 2].map((axis) => { const [low, high] = range(axis); return 1.5 * (high - low) / size; });
      const scene = { xaxis: one(0, "x"), yaxis: one(1, "y"), zaxis: one(2, "z"), aspectmode: "manual", aspectratio: { x: ratio[0], y: ratio[1], z: ratio[2] },
        camera: isNarrow() ? { eye: { x: -1.2, y: -2.7, z: 2 }, center: { x: -0.15, y: 0, z: -0.2 } } : { eye: { x: -1.05, y: -2, z: 1.55 }, center: { x: -0.1, y: 0, z: -0.25 } } };
      return { data, more: { scene, margin: { l: 0, r: 0, t: 0, b: 0 }, legend: { orientation: "h", y: 0, x: 0 } } };
    },
    move(div, instant) {
      const found = parts(instant), same = Array(6).fill(undefined);
      Plotly.restyle(div, {
        x: found.map((f) => f.x), y: found.map((f) => f.y), z: found.map((f) => f.z),
        ...(select.value === "estimated" ? { colorscale: [damageColours(instant).colorscale, ...same], "colorbar.title.text": [damageColours(instant).unit, ...same] } : {}),
        intensity: [intensity(instant), ...same], hovertext: found.map((f) => f.hovertext),
      });
    },
  });
  select.addEventListener("change", () => draw(figure));
}
