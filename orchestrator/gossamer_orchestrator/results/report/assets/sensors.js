// Sensors and their compensators: resistance, strain with its band, error, loop and spectrum; then what else was recorded.
const chosen = () => page.content.sensors[page.sensor];

function curve(name, x, y, color, more) {
  return { type: "scatter", mode: "lines", name, x, y, line: { color, width: 1.4, ...(more || {}).line }, ...(more || {}).rest };
}

// In s, shorter than a second in ms, in at most three digits.
function duration(seconds) {
  const [value, unit] = seconds >= 1 ? [seconds, "s"] : [1e3 * seconds, "ms"];
  return `${Number(value.toPrecision(3))} ${unit}`;
}

// In two digits and no power of ten, a large one in whole numbers.
const inTwoDigits = (value) => (value < 1e-9 ? "< 1e-9" : value < 99.5 ? `${Number(value.toPrecision(2))}` : value.toFixed(0));

// Words in the lower right corner of a picture.
const inCorner = (text, colors) => (text ? [{ text, xref: "paper", yref: "paper", x: 1, y: 0, xanchor: "right", yanchor: "bottom", showarrow: false, bgcolor: translucent(colors.panel, 0.85) }] : []);

// Lower and upper edge of a band, filled between.
function band(x, low, high, color, name) {
  const edge = (y, more) => curve(name, x, y, color, { line: { width: 0 }, rest: { hoverinfo: "skip", ...more } });
  return [edge(low, { showlegend: false }), edge(high, { fill: "tonexty", fillcolor: translucent(color, 0.25) })];
}

function addSensors() {
  const { content } = page;
  const usable = content.sensors.filter((each) => Object.keys(each.curves).length);
  content.sensors = usable;
  if (!usable.length) return;
  heading("Sensors");
  const select = element("select", { id: "sensor" });
  usable.forEach((each, k) => select.append(element("option", { value: `${k}` }, [`${each.number}`, ...[[each.sensor, each.compensator].filter(Boolean).join(", ")].filter(Boolean)].join(": "))));
  document.getElementById("pictures").append(element("p", { class: "picker" }, element("label", { for: "sensor" }, "Sensor "), select));
  const some = (...names) => usable.some((each) => names.some((name) => each.curves[name]));
  const figures = [];
  const add = (figure) => figures.push(addFigure(figure));
  if (some("strain", "compensated")) add({
    title: "Strain", timed: true, broad: true,
    note: (!some("compensated") ? "" : some("strain") ? "True strain, and that of the compensator without its delay." : "Strain of the compensator without its delay; the true strain is not recorded.")
      + (some("low") ? " The band is two strain_deviation wide to each side: the error that the compensator expects of noise and drift. It does not cover a sensor that behaves otherwise than it was identified, nor spikes of its resistance." : ""),
    label: `${[some("strain") && "True strain", some("compensated") && "Compensated strain"].filter(Boolean).join(" and ")} over time.`,
    make(colors) {
      const { curves, delay, rms, span, number } = chosen(), t = content.time, data = [];
      const earlier = delay ? t.map((value) => value - delay) : t;
      if (curves.low) data.push(...band(earlier, curves.low, curves.high, colors.lines[1], "± 2 deviations"));
      if (curves.strain) data.push(curve("true", t, curves.strain, colors.grey, { line: { width: curves.compensated ? 4 : 2 } }));
      const late = delay ? `compensated, drawn ${duration(delay)} earlier` : "compensated";
      if (curves.compensated) data.push(curve(late, earlier, curves.compensated, colors.lines[1], { line: { width: 1.2 } }));
      const text = span ? `sensor ${number}: RMS error ${rms.toPrecision(2)}, ${inTwoDigits(100 * rms / span)} % of range` : "";
      return { data, more: { annotations: inCorner(text, colors), xaxis: axis(colors, "time [s]"), yaxis: axis(colors, "strain [1]") } };
    },
  });
  if (some("error")) add({
    title: "Error of the compensated strain", timed: true, note: "Compensated minus true strain of the same time, and two standard deviations as the compensator states them.",
    make(colors) {
      const { curves, beyond, number } = chosen(), t = content.time, data = [];
      if (curves.above) data.push(...band(t, curves.above.map((value) => -value), curves.above, colors.lines[1], "± 2 deviations"));
      if (curves.error) data.push(curve("error", t, curves.error, colors.lines[0]));
      const top = 1.5 * (curves.error || []).reduce((most, value) => Math.max(most, Math.abs(value) || 0), 1e-12);
      const text = beyond === undefined ? "" : `sensor ${number}: ${beyond ? inTwoDigits(100 * beyond) : 0} % of the points leave the band;${isNarrow() ? "<br>" : " "}5 % would be right`;
      return { data, more: { annotations: inCorner(text, colors), xaxis: axis(colors, "time [s]"), yaxis: axis(colors, "error [1]", { range: [-top, top] }) } };
    },
  });
  if (some("resistance", "reading")) add({
    title: "Resistance", timed: true, label: "Resistance of the sensor over time, and as the compensator reads it.",
    make(colors) {
      const { curves } = chosen(), data = [];
      if (curves.resistance) data.push(curve("of the sensor", content.time, curves.resistance, colors.lines[0], { line: { width: curves.reading ? 4 : 1.4 } }));
      if (curves.reading) data.push(curve("as read", content.time, curves.reading, colors.lines[1], { line: { width: 1.2 } }));
      return { data, more: { xaxis: axis(colors, "time [s]"), yaxis: axis(colors, "resistance [Ω]") } };
    },
  });
  const marker = (instant) => { const { at } = chosen(); return { x: [at ? [at.strain[instant]] : []], y: [at ? [at.resistance[instant]] : []] }; };
  if (usable.some((each) => each.loops)) add({
    title: "Resistance against strain", note: "The diamond is the slider's time.", label: "Loops of resistance against strain: hysteresis and drift.",
    make(colors) {
      const data = (chosen().loops || []).map((loop, k) => curve(loop.name, loop.strain, loop.resistance, colors.lines[k]));
      const { x: [x], y: [y] } = marker(page.instant);
      data.push({ type: "scatter", mode: "markers", x, y, name: "now", cliponaxis: false, marker: { symbol: "diamond", size: 12, color: colors.ink, line: { color: colors.panel, width: 1.5 } } });
      return { data, more: { xaxis: axis(colors, "strain [1]"), yaxis: axis(colors, "resistance [Ω]") } };
    },
    move(div, instant) { Plotly.restyle(div, marker(instant), [div.data.length - 1]); },
  });
  if (usable.some((each) => each.spectrogram)) add({
    title: "Spectrogram of the strain", timed: true, note: "Decimal logarithm of the amplitude, under Hann's window, without the mean.",
    label: "Amplitude of the strain over time and frequency.",
    make(colors) {
      const found = chosen().spectrogram, data = found ? [{ type: "heatmap", x: found.time, y: found.frequency, z: found.level, colorscale: "Viridis",
        zmin: Math.max(bottom(found.level), -10), colorbar: { title: { text: "log₁₀" }, thickness: 12 }, hovertemplate: "%{x:.4g} s, %{y:.4g} Hz: 10^%{z:.2f}<extra></extra>" }] : [];
      return { data, more: { hovermode: "closest", xaxis: axis(colors, "time [s]"), yaxis: axis(colors, "frequency [Hz]") } };
    },
  });
  if (usable.some((each) => (each.loops || []).some((loop) => loop.frequency))) add({
    title: "Spectrum of the resistance", note: "Amplitudes under Hann's window, without the mean.",
    make(colors) {
      const data = (chosen().loops || []).filter((loop) => loop.frequency).map((loop, k) => curve(loop.name, loop.frequency, loop.amplitude, colors.lines[k], { line: { width: 1.1 } }));
      const powers = { type: "log", dtick: 1, labelalias: { 1: "10<sup>0</sup>", 10: "10<sup>1</sup>" }, minor: { dtick: "D1", ticks: "outside", tickcolor: colors.soft } };
      return { data, more: { xaxis: axis(colors, "frequency [Hz]", powers), yaxis: axis(colors, "amplitude [Ω]", powers) } };
    },
  });
  select.addEventListener("change", () => { page.sensor = Number(select.value); drawAnew(figures); });
}

function addDeflection() {
  const { content } = page;
  if (!content.deflection) return;
  addFigure({
    title: "Deflection of the membrane's centre", timed: true, tall: content.square,
    make(colors) {
      const data = [curve("centre", content.time, content.deflection.map((value) => 1e3 * value), colors.lines[0])];
      return { data, more: { showlegend: false, xaxis: axis(colors, "time [s]"), yaxis: axis(colors, "deflection [mm]") } };
    },
  });
}

// A panel for each unit; a few variables are its title.
function addOthers() {
  const { content } = page, units = [...new Set(content.others.map((each) => each.unit))];
  if (!units.length) return;
  heading("What else was recorded");
  for (const unit of units) {
    const some = content.others.filter((each) => each.unit === unit).slice(0, 24), text = `[${unit || "1"}]`;
    addFigure({
      title: some.length < 4 ? some.map((each) => each.name).join(", ") : `Recorded variables in ${text}`, timed: true, broad: true,
      make(colors) {
        const data = some.map((each, k) => curve(each.name, content.time, each.values, colors.lines[k % 6], { line: { dash: ["solid", "dash", "dot", "dashdot"][Math.floor(k / 6)] } }));
        return { data, more: { showlegend: true, xaxis: axis(colors, "time [s]"), yaxis: axis(colors, text) } };
      },
    });
  }
}
