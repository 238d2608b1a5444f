// The membrane of the start page: plotly draws the pictures of motion.js one after another, to scale.
(() => {
  const SIDE = 0.6; // [m], stretched
  const place = document.getElementById("membrane"), button = document.getElementById("membrane-button");
  const time = document.getElementById("membrane-time");
  if (!place || typeof Plotly === "undefined") return;
  const inside = Math.sqrt(motion.w[0].length), nodes = inside + 2;
  const along = Array.from({ length: nodes }, (_, i) => (SIDE * i) / (nodes - 1));
  const top = Math.max(...motion.w.flat().map(Math.abs)) / 10; // [mm]
  // Rows of equal y, as plotly wants them; the edge is fixed.
  const surface = (k) => along.map((_, j) => along.map((_, i) => {
    const edge = i === 0 || j === 0 || i === nodes - 1 || j === nodes - 1;
    return edge ? 0 : motion.w[k][(i - 1) * inside + (j - 1)] / 10;
  }));
  const stride = (nodes - 1) / 4; // four zones along a side, an element each
  const line = (z, points) => ({
    x: points.map((p) => p && along[p[0]]), y: points.map((p) => p && along[p[1]]), z: points.map((p) => p && z[p[1]][p[0]] + 0.01 * top),
  });
  const walk = (from, to) => Array.from({ length: Math.max(Math.abs(to[0] - from[0]), Math.abs(to[1] - from[1])) + 1 }, (_, n) =>
    [from[0] + n * Math.sign(to[0] - from[0]), from[1] + n * Math.sign(to[1] - from[1])]);
  const grid = [];
  for (let n = 0; n < nodes; n += stride) grid.push(...walk([n, 0], [n, nodes - 1]), null, ...walk([0, n], [nodes - 1, n]), null);
  const outlines = Object.keys(motion.damage).flatMap((zone) => {
    const i = stride * ((zone - 1) % 4), j = stride * Math.floor((zone - 1) / 4), corners = [[i, j], [i + stride, j], [i + stride, j + stride], [i, j + stride], [i, j]];
    return [...corners.slice(1).flatMap((corner, n) => walk(corners[n], corner)), null];
  });
  const zones = Array.from({ length: 16 }, (_, n) => [stride * (n % 4 + 0.5), stride * (Math.floor(n / 4) + 0.5)]); // their middles
  const damaged = (k) => (k >= motion.onset ? outlines : [null]);
  const isDark = () => document.body.getAttribute("data-md-color-scheme") === "slate";
  const ink = () => (isDark() ? "#e6eaee" : "#1b2026");
  // Deflections have two signs: none is the colour of the paper.
  const colors = () => (isDark() ? ["#8fd0f5", "#2f7fb8", "#2a323c", "#a87416", "#ffd166"] : ["#2f7fb8", "#8fc1e3", "#eef0f2", "#ecb94f", "#c47f00"]).map((color, i) => [i / 4, color]);
  const narrow = place.clientWidth < 500, far = narrow ? 1.0 : 0.78;
  const bar = narrow ? { orientation: "h", x: 0.5, y: 0, yanchor: "bottom", len: 0.8, title: { text: "deflection [mm]", side: "top" } } : { x: 0.99, xanchor: "right", len: 0.8, title: { text: "deflection<br>[mm]" } };
  const z = surface(0), plain = { visible: false };
  Plotly.newPlot(place, [
    { type: "surface", x: along, y: along, z, cmin: -top, cmax: top, colorscale: colors(), hoverinfo: "skip", colorbar: { ...bar, thickness: 10, nticks: 5 } },
    { type: "scatter3d", mode: "lines", ...line(z, grid), line: { color: ink(), width: 2 }, hoverinfo: "skip" },
    { type: "scatter3d", mode: "text", ...line(z, zones), text: zones.map((_, n) => String(n + 1)), textfont: { color: ink(), size: narrow ? 10 : 13 }, hoverinfo: "skip" },
    { type: "scatter3d", mode: "lines", ...line(z, damaged(0)), line: { color: "#D55E00", width: 8 }, hoverinfo: "skip" },
  ], {
    paper_bgcolor: "rgba(0,0,0,0)", font: { color: ink() }, showlegend: false, margin: { l: 0, r: 0, t: 0, b: 0 },
    scene: { xaxis: plain, yaxis: plain, zaxis: { ...plain, range: [-1.1 * top, 1.1 * top] }, aspectmode: "manual", aspectratio: { x: 1, y: 1, z: (2.2 * top) / (1e3 * SIDE) },
      camera: { eye: { x: -0.7 * far, y: -1.3 * far, z: 0.6 * far }, center: { x: narrow ? 0 : 0.06, y: 0, z: narrow ? -0.1 : -0.03 } } },
  }, { displayModeBar: false, responsive: true });
  new MutationObserver(() => Plotly.update(place, { colorscale: [colors()], "line.color": [undefined, ink()], "textfont.color": [undefined, undefined, ink()] }, { "font.color": ink() }, [0, 1, 2]))
    .observe(document.body, { attributeFilter: ["data-md-color-scheme"] }); // the theme sets it late, and readers change it
  let picture = 0, moving = !window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  const show = () => {
    const heights = surface(picture), lines = [grid, zones, damaged(picture)].map((points) => line(heights, points));
    Plotly.restyle(place, { x: [along, ...lines.map((l) => l.x)], y: [along, ...lines.map((l) => l.y)], z: [heights, ...lines.map((l) => l.z)] });
    const state = picture < motion.onset ? "no damage" : "zones " + Object.keys(motion.damage).join(" and ") + " are damaged";
    time.textContent = (1e3 * motion.time * picture).toFixed(0) + " ms, " + state;
    button.textContent = moving ? "Pause" : "Play";
  };
  button.addEventListener("click", () => { moving = !moving; show(); });
  setInterval(() => { if (moving && !document.hidden) { picture = (picture + 1) % motion.w.length; show(); } }, 80);
  show();
})();
