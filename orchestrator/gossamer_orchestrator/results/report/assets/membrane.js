// In a narrow window the scale of colours lies above the membrane, not beside it.
const colorbarOf = (title) => ({ ...title, ...(isNarrow() ? { orientation: "h", x: 0.5, y: 1, yanchor: "top", len: 0.85, thickness: 10 } : { thickness: 12, len: 0.75, x: 1.0 }) });

// An axis in space, of small letters, so that its numbers find place beside the membrane.
const placeIn3d = (colors) => ({ gridcolor: colors.grid, zerolinecolor: colors.grid, backgroundcolor: "rgba(0,0,0,0)", tickfont: { size: isNarrow() ? 10 : 11 }, title: { font: { size: 12 } } });

// Numbers of sensors stand in dots, those of zones in squares: so they can be read on every colour.
const numbered = (symbol, size, fill, ink) => ({ type: "scatter3d", mode: "markers+text", textposition: "middle center", textfont: { size: isNarrow() ? 9 : 11, color: ink },
  marker: { symbol, size: isNarrow() ? 0.8 * size : size, color: fill, line: { color: ink, width: 1 } } });
const sensorDots = () => ({ ...numbered("circle", 7, "#CC79A7", "#000000"), name: "sensors", hoverinfo: "text" });
const zoneSquares = (colors) => ({ ...numbered("square", 6, colors.panel, colors.ink), hoverinfo: "skip", showlegend: false });
const upTo = (count) => Array.from({ length: count }, (_, k) => `${k + 1}`);

// What a sensor shows at an instant; its strain is not known before its compensator has stated it.
function sensorText(number, instant) {
  const { at } = page.content.sensors.find((each) => each.number === number) || {};
  if (!at) return `sensor ${number}`;
  const strain = Number.isFinite(at.strain[instant]) ? at.strain[instant].toPrecision(4) : "not known yet";
  return `sensor ${number}<br>strain ${strain}<br>resistance ${at.resistance[instant].toPrecision(5)} Ω`;
}

// A membrane of unknown shape, flat.
function flatMembrane(zones) {
  const nodes = 2 * zones + 1;
  const sensors = page.content.sensors.length === 4 ? [[1, 1], [2, 1], [1, 2], [2, 2]].map(([i, j]) => [i / 3, j / 3]) : [];
  const [side, unit] = page.content.side;
  return { nx: nodes, ny: nodes, side, unit, flat: true, sensors, w: [new Float32Array(nodes * nodes)] };
}

// Deflection between the nodes, as the elements interpolate it.
function heightAt(mesh, w, x, y) {
  const u = Math.min(x * (mesh.nx - 1), mesh.nx - 1 - 1e-9), v = Math.min(y * (mesh.ny - 1), mesh.ny - 1 - 1e-9);
  const i = Math.floor(u), j = Math.floor(v), a = u - i, b = v - j, at = (p, q) => w[p * mesh.ny + q];
  return (1 - a) * ((1 - b) * at(i, j) + b * at(i, j + 1)) + a * ((1 - b) * at(i + 1, j) + b * at(i + 1, j + 1));
}

// The membrane as a surface; z is its deflection, x and y count from its corner.
function addMembrane() {
  const { content } = page, damage = content.damage;
  const zoneCount = damage ? (damage.windows || damage.true)[damage.windows ? "estimated" : "values"][0].length : 16;
  const zones = Math.round(Math.sqrt(zoneCount)), squares = zones * zones === zoneCount;
  if (!content.membrane && !(damage && squares)) return;
  const mesh = content.membrane || flatMembrane(zones);
  const scale = 1e3, lift = { top: 0 };
  for (const w of mesh.w) for (const value of w) lift.top = Math.max(lift.top, Math.abs(scale * value));
  const top = lift.top || 1, side = mesh.side;
  const X = [], Y = [], I = [], J = [], K = [], cells = [];
  for (let i = 0; i < mesh.nx; i++) for (let j = 0; j < mesh.ny; j++) { X.push(side * i / (mesh.nx - 1)); Y.push(side * j / (mesh.ny - 1)); }
  for (let i = 0; i + 1 < mesh.nx; i++) for (let j = 0; j + 1 < mesh.ny; j++) {
    const a = i * mesh.ny + j, b = a + mesh.ny;
    I.push(a, a); J.push(b, b + 1); K.push(b + 1, a + 1);
    const zone = Math.floor(zones * (j + 0.5) / (mesh.ny - 1)) * zones + Math.floor(zones * (i + 0.5) / (mesh.nx - 1));
    cells.push(zone, zone);
  }
  const choices = [];
  if (!mesh.flat) choices.push(["deflection", "deflection"]);
  if (damage && squares && damage.windows) choices.push(["estimated", "estimated damage"]);
  if (damage && squares && damage.true) choices.push(["true", "true damage"]);
  const select = element("select", { "aria-label": "Colour of the membrane" });
  for (const [value, text] of choices) select.append(element("option", { value }, text));

  const surface = (instant) => mesh.w[Math.min(instant, mesh.w.length - 1)];
  // Lines over the surface, through points [x, y] in parts of the side; null ends a line.
  const over = (instant, paths) => {
    const w = surface(instant), x = [], y = [], z = [];
    for (const path of paths) {
      for (let p = 0; p + 1 < path.length; p++) for (let s = 0; s <= 12; s++) {
        const px = path[p][0] + (path[p + 1][0] - path[p][0]) * s / 12, py = path[p][1] + (path[p + 1][1] - path[p][1]) * s / 12;
        x.push(side * px); y.push(side * py); z.push(scale * heightAt(mesh, w, px, py) + 0.012 * top);
      }
      x.push(null); y.push(null); z.push(null);
    }
    return { x, y, z };
  };
  const grid = [];
  for (let n = 0; n <= zones; n++) for (let s = 0; s < zones; s++) {
    grid.push([[n / zones, s / zones], [n / zones, (s + 1) / zones]], [[s / zones, n / zones], [(s + 1) / zones, n / zones]]);
  }
  const outline = (zone) => {
    const x = (zone % zones) / zones, y = Math.floor(zone / zones) / zones, d = 1 / zones, e = 0.06 * d;
    return [[x + e, y + e], [x + d - e, y + e], [x + d - e, y + d - e], [x + e, y + d - e], [x + e, y + e]];
  };
  const outlines = (values, least) => squares && values ? Array.from(values.keys()).filter((z) => values[z] >= least).map(outline) : [];
  const points = (instant) => ({
    x: mesh.sensors.map(([x]) => side * x), y: mesh.sensors.map(([, y]) => side * y),
    z: mesh.sensors.map(([x, y]) => scale * heightAt(mesh, surface(instant), x, y) + 0.22 * top),
    hovertext: mesh.sensors.map((_, k) => sensorText(k + 1, instant)),
  });
  const zoneTexts = (instant) => {
    const centres = Array.from({ length: zoneCount }, (_, z) => [(z % zones + 0.5) / zones, (Math.floor(z / zones) + 0.13) / zones]);
    return { x: centres.map(([x]) => side * x), y: centres.map(([, y]) => side * y),
             z: centres.map(([x, y]) => scale * heightAt(mesh, surface(instant), x, y) + 0.16 * top) };
  };
  const intensity = (instant) => {
    if (select.value === "deflection") return Array.from(surface(instant), (value) => scale * value);
    const values = select.value === "true" ? trueAt(content.frames[instant]) : estimatedAt(content.frames[instant]);
    return cells.map((zone) => (values ? 100 * values[zone] : 0));
  };
  const damageColours = (instant) => coloursOf(select.value, content.frames[instant]);
  const parts = (instant) => {
    const time = content.frames[instant];
    return [over(instant, grid), over(instant, outlines(damage && judgedAt(time), leastFound())),
            over(instant, outlines(damage && trueAt(time), 1e-9))];
  };
  const figure = addFigure({
    title: "Membrane", tall: true, slow: true, control: select,
    note: mesh.flat ? "Deflections of the nodes (membrane.w) are not recorded, so it is drawn flat." : "Heights have a scale of their own. Drag to turn; squares are zones, dots sensors.",
    label: "The membrane in three dimensions, with zones, sensors and damaged zones marked; the tables below hold the numbers.",
    make(colors) {
      const [lines, estimated, real] = parts(page.instant), deflected = select.value === "deflection";
      const line = (found, more, name) => ({ type: "scatter3d", mode: "lines", ...found, line: more, name, hoverinfo: "skip" });
      const skin = { type: "mesh3d", x: X, y: Y, z: Array.from(surface(page.instant), (value) => scale * value), i: I, j: J, k: K,
        intensity: intensity(page.instant), intensitymode: deflected ? "vertex" : "cell", cmin: deflected ? -top : 0, cmax: deflected ? top : topDamage(),
        colorscale: deflected ? signedScale(colors) : damageColours(page.instant).colorscale, flatshading: false, lighting: { ambient: 0.75, diffuse: 0.5, specular: 0.05 },
        colorbar: colorbarOf({ title: { text: deflected ? "mm" : damageColours(page.instant).unit } }), hoverinfo: "skip", showscale: true };
      const data = [skin, line(lines, { color: colors.dark ? "#cfd6dd" : "#3d4650", width: 2 }, "zones"),
        line(estimated, { color: "#D55E00", width: 7 }, "judged damaged"),
        line(real, { color: colors.dark ? "#ffffff" : "#000000", width: 4, dash: "dash" }, "truly damaged"),
        { ...sensorDots(), ...points(page.instant), text: upTo(mesh.sensors.length) },
        { ...zoneSquares(colors), ...zoneTexts(page.instant), text: upTo(zoneCount) }];
      data[1].showlegend = false;
      data[2].showlegend = Boolean(damage && damage.windows);
      data[3].showlegend = Boolean(damage && damage.true);
      const place = { ...placeIn3d(colors), nticks: 4 };
      const power = 10 ** Math.floor(Math.log10(top)), highest = power * Math.floor(top / power); // a tick apart from those of y
      const titled = (text) => ({ ...place, title: { ...place.title, text } });
      const scene = { xaxis: titled(`x [${mesh.unit}]`), yaxis: titled(`y [${mesh.unit}]`),
        zaxis: { ...titled(mesh.flat ? "" : "w [mm]"), tickvals: [0, highest], range: [-1.1 * top, 1.1 * top], visible: !mesh.flat },
        aspectmode: "manual", aspectratio: { x: 1.25, y: 1.25, z: 0.45 },
        camera: isNarrow() ? { eye: { x: -1, y: -2.3, z: 1.6 }, center: { x: -0.18, y: 0, z: -0.1 } } : { eye: { x: -0.75, y: -1.55, z: 1.1 }, center: { x: -0.05, y: 0, z: -0.16 } } };
      return { data, more: { scene, margin: { l: 0, r: 0, t: 0, b: 0 }, legend: { orientation: "h", y: 0, x: 0 } } };
    },
    move(div, instant) {
      const found = [...parts(instant), points(instant), zoneTexts(instant)];
      const values = intensity(instant), same = Array(5).fill(undefined);
      const heights = Array.from(surface(instant), (value) => scale * value);
      Plotly.restyle(div, {
        x: [X, ...found.map((f) => f.x)], y: [Y, ...found.map((f) => f.y)], z: [heights, ...found.map((f) => f.z)],
        ...(select.value === "estimated" ? { colorscale: [damageColours(instant).colorscale, ...same], "colorbar.title.text": [damageColours(instant).unit, ...same] } : {}),
        intensity: [values, ...same], hovertext: [undefined, ...found.map((f) => f.hovertext)],
      });
    },
  });
  select.addEventListener("change", () => draw(figure));
}
