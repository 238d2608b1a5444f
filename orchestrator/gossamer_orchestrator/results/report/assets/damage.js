// Damage: what the detector judged, over zones and over time, beside the truth where it is recorded.
const MOST_MARKERS = 300; // more would be a line, and slow
const percent = (values) => Array.from(values, (value) => 100 * value);
const stated = (values) => values.some((value) => Number.isFinite(value));
const isSure = (found) => Boolean(found && stated(found.deviation[found.deviation.length - 1]));

function estimatedAt(time) {
  const found = page.content.damage && page.content.damage.windows;
  if (!found) return null;
  const k = lastBefore(found.time, time);
  return k < 0 ? null : found.estimated[k];
}

// Before the first judgement there is none that is not valid.
function isValidAt(time) {
  const found = page.content.damage && page.content.damage.windows;
  const k = found ? lastBefore(found.time, time) : -1;
  return k < 0 || found.valid[k];
}

// Only a valid judgement calls a zone damaged, and has the colours of damage.
const judgedAt = (time) => (isValidAt(time) ? estimatedAt(time) : null);
const judgedScale = (colors, time) => (isValidAt(time) ? damageScale(colors) : greyScale(colors));

// Colours of a membrane in space and their unit, for true or estimated damage.
function coloursOf(which, time) {
  const valid = which === "true" || isValidAt(time);
  return { colorscale: valid ? damageScale(theme()) : greyScale(theme()), unit: valid ? "%" : "%, not valid" };
}

// Words above a picture of a judgement that is not valid; the margin has place for them.
const NOT_VALID_ROOM = 30;
const notValid = (colors, time) => (isValidAt(time) ? [] : [{ text: "<b>not valid</b>", xref: "paper", yref: "y domain", x: 0.5, y: 1, yanchor: "bottom",
  showarrow: false, font: { color: colors.alarm, size: 15 } }]);

function trueAt(time) {
  const known = page.content.damage && page.content.damage.true;
  return known ? known.values[Math.max(0, lastBefore(known.time, time))] : null;
}

// As the verdict has it: any damage of a detector that states its deviation, 5 % of one that does not.
function leastFound() {
  return isSure(page.content.damage && page.content.damage.windows) ? 5e-4 : 0.05;
}

function topDamage() {
  const { windows, true: known } = page.content.damage;
  const all = [...(windows ? windows.estimated : []), ...(known ? known.values : [])];
  return Math.max(50, ...all.map((values) => 100 * values.reduce((a, b) => Math.max(a, b), 0)));
}

function addDamage() {
  const damage = page.content.damage;
  if (!damage) return;
  const found = damage.windows, known = damage.true;
  if (!found && !known.values.some((row) => row.some((value) => value > 0))) return;
  const count = (found ? found.estimated : known.values)[0].length, side = Math.round(Math.sqrt(count));
  const square = side * side === count && page.content.square;
  if (square) addMap(found, known, side);
  addBars(found, known, count, square);
  addHistory(damage, found, known, count);
}

// The colour of words on a map of damage, of so much of its scale: 4.4:1 of contrast or more.
const inkOn = (share, colors) => ((colors.dark ? share < 0.48 : share > 0.7) ? "#ffffff" : "#000000");

function addMap(found, known, side) {
  const labels = Array.from({ length: side }, (_, i) => i + 1), top = topDamage();
  const zones = labels.flatMap((row) => labels.map((column) => [column, row]));
  const fill = (time) => {
    const k = found ? lastBefore(found.time, time) : -1, truth = trueAt(time), values = k < 0 ? null : found.estimated[k];
    const shown = values || (found ? null : truth), colors = theme();
    const text = zones.map((_, zone) => {
      const bar = values && Number.isFinite(found.deviation[k][zone]) ? `<br>± ${(100 * found.deviation[k][zone]).toFixed(1)}` : "";
      const real = found && truth && truth[zone] > 0 ? `<br>true ${(100 * truth[zone]).toFixed(0)}` : "";
      return `<i>${zone + 1}</i><br>` + (shown ? `<b>${(100 * shown[zone]).toFixed(1)}</b>` : "–") + bar + real;
    });
    const z = labels.map((row) => labels.map((column) => (shown ? 100 * shown[(row - 1) * side + column - 1] : 0)));
    const valid = isValidAt(time), ink = z.flat().map((value) => (valid ? inkOn(value / top, colors) : colors.ink));
    return { z, text, ink, scale: judgedScale(colors, time), annotations: notValid(colors, time) };
  };
  addFigure({
    title: found ? "Damage of the zones [%], judged at the slider's time" : "True damage of the zones [%]", tall: true,
    note: !found ? "Zone number and damage." : `Zone number, estimate, standard deviation${known ? ", and the true damage where there is some" : "; the true damage is not recorded"}.${found.valid.every(Boolean) ? "" : " A judgement that is not valid is grey."}`,
    label: "Map of the damage of every zone; the table of damage in numbers holds the last judgement.",
    make(colors) {
      const { z, text, ink, scale, annotations } = fill(page.content.frames[page.instant]);
      const data = [
        { type: "heatmap", x: labels, y: labels, z, showscale: !isNarrow(), zmin: 0, zmax: top, xgap: 2, ygap: 2, colorscale: scale,
          colorbar: { title: { text: "%" }, thickness: 12 }, hoverinfo: "skip" },
        { type: "scatter", mode: "text", x: zones.map(([x]) => x), y: zones.map(([, y]) => y), text, textfont: { color: ink, size: 12 }, hoverinfo: "skip" }];
      const bare = { showgrid: false, zeroline: false, showticklabels: false, ticks: "", constrain: "domain", range: [0.5, side + 0.5] };
      const t = !found || found.valid.every(Boolean) ? 10 : NOT_VALID_ROOM;
      return { data, more: { annotations, dragmode: false, showlegend: false, xaxis: axis(colors, "x →", bare), yaxis: axis(colors, "y →", { ...bare, scaleanchor: "x" }), margin: { l: 30, r: 10, t, b: 30 } } };
    },
    move(div, instant, time) {
      const { z, text, ink, scale, annotations } = fill(time);
      Plotly.update(div, { z: [z, undefined], colorscale: [scale, undefined], text: [undefined, text], "textfont.color": [undefined, ink] }, { annotations });
    },
  });
}

const inBars = (words) => words.map((each) => ({ ...each, x: 1, xanchor: "right", yanchor: "top" }));

function addBars(found, known, count, beside) {
  const zones = Array.from({ length: count }, (_, z) => z + 1), sure = isSure(found);
  const fill = (time) => {
    const k = found ? lastBefore(found.time, time) : -1, truth = trueAt(time), none = zones.map(() => null), valid = isValidAt(time), colors = theme();
    return { values: k < 0 ? none : percent(found.estimated[k]), bars: k < 0 || !valid ? none : percent(found.deviation[k]).map((value) => 2 * value || 0),
             truth: truth ? percent(truth) : none, color: valid ? colors.lines[0] : colors.grey, annotations: inBars(notValid(colors, time)) };
  };
  addFigure({
    title: `${found ? "Damage" : "True damage"} of each zone${sure ? " with two standard deviations" : ""}`, tall: beside, broad: !beside,
    label: found ? `Bars: estimated damage of each zone${sure ? " with two standard deviations to each side" : ""}; diamonds: true damage.` : "",
    make(colors) {
      const { values, bars, truth, color, annotations } = fill(page.content.frames[page.instant]);
      const data = [
        { type: "bar", x: zones, y: values, name: "estimated", visible: Boolean(found), marker: { color },
          error_y: { type: "data", array: bars, color: colors.ink, thickness: 1.5, width: 4 } },
        { type: "scatter", mode: "markers", x: zones, y: truth, name: "true", visible: Boolean(known), cliponaxis: false,
          marker: { symbol: "diamond-open", size: 11, color: colors.lines[1], line: { width: 2 } } }];
      return { data, more: { annotations, xaxis: axis(colors, "zone", { range: [0.4, count + 0.6], tick0: 1, dtick: count > 40 ? undefined : count > 8 && isNarrow() ? 3 : 1 }), yaxis: axis(colors, "damage [%]", { range: [-0.06 * topDamage(), 1.15 * topDamage()] }) } };
    },
    move(div, instant, time) {
      const { values, bars, truth, color, annotations } = fill(time);
      Plotly.restyle(div, { y: [values, truth] });
      Plotly.update(div, { "error_y.array": [bars], "marker.color": [color] }, { annotations }, [0]);
    },
  });
}

// Zones that matter in colour: truly damaged ones, then those judged damaged most; the others grey, and all where no judgement is valid.
function addHistory(damage, found, known, count) {
  const most = (rows, zone) => rows.reduce((top, row) => Math.max(top, row[zone] || 0), 0);
  const zones = Array.from({ length: count }, (_, z) => z);
  const real = known ? zones.filter((z) => most(known.values, z) > 0) : [];
  const judged = found ? found.estimated.filter((_, k) => found.valid[k]) : [];
  const suspects = zones.filter((z) => !real.includes(z) && most(judged, z) >= Math.max(0.03, leastFound()));
  suspects.sort((a, b) => most(judged, b) - most(judged, a));
  const shown = [...real, ...suspects].slice(0, 6), watch = page.content.watch || {};
  const findings = watch.findings || [], alarms = watch.alarms || [], sure = isSure(found);
  addFigure({
    title: "Damage over time", timed: true, broad: true,
    note: (found && found.time.length <= MOST_MARKERS ? "A dot stands at each valid judgement, a cross at one that is not valid. " : "")
      + (sure ? "Bands are two standard deviations wide to each side, but not below 0." : "")
      + (found && judged.length < found.valid.length ? " What is not valid has no band and no colour: the grey line is then the largest of all zones." : "")
      + (alarms.length ? " A line marks each alarm of the digital twin, a diamond the onset that it found." : ""),
    label: found ? "Estimated damage of the zones over time, true damage dashed, with alarms and onsets." : "",
    make(colors) {
      const data = [];
      const step = (x, y, more) => data.push({ type: "scatter", mode: "lines", x, y, line: { shape: "hv", width: 2, ...more.line }, ...more.rest });
      if (found) {
        const x = [...found.time, page.content.end];
        const held = (row) => [...row, row[row.length - 1]];
        const rest = zones.filter((z) => !shown.includes(z)), largest = (row, k) => 100 * (found.valid[k] ? rest : zones).reduce((top, z) => Math.max(top, row[z]), 0);
        // What holds from each valid window to the next window.
        const times = found.valid.flatMap((valid, k) => (valid ? [x[k], x[k + 1]] : [x[k]]));
        const valued = (values) => found.valid.flatMap((valid, k) => (valid ? [values[k], values[k]] : [null]));
        if (rest.length || judged.length < found.valid.length) step(x, held(found.estimated.map(largest)),
          { line: { color: colors.grey, width: 1 }, rest: { name: "largest of the others", hoverinfo: "skip" } });
        (judged.length ? shown : []).forEach((z, i) => {
          const color = colors.lines[i], group = `${z}`, band = `zone ${z + 1} ± 2 deviations`, bar = (sign) => held(found.estimated.map((row, k) => (found.valid[k] ? Math.max(0, 100 * (row[z] + 2 * sign * found.deviation[k][z])) : 0)));
          if (sure) {
            step(x, bar(-1), { line: { width: 0, color }, rest: { name: band, legendgroup: group, showlegend: false, hoverinfo: "skip" } });
            step(x, bar(1), { line: { width: 0, color }, rest: { name: band, legendgroup: group, showlegend: false, hoverinfo: "skip", fill: "tonexty", fillcolor: translucent(color, 0.25) } });
          }
          step(times, valued(found.estimated.map((row) => 100 * row[z])), { line: { color }, rest: { name: `zone ${z + 1}`, legendgroup: group } });
        });
        for (const [valid, symbol, name] of [[true, "circle", "judgement"], [false, "x", "not valid"]]) {
          const some = found.valid.map((value, k) => k).filter((k) => found.valid[k] === valid);
          if (some.length && some.length <= MOST_MARKERS) data.push({ type: "scatter", mode: "markers", x: some.map((k) => found.time[k]), y: some.map((k) => 100 * Math.max(...found.estimated[k])),
            name, cliponaxis: false, marker: { symbol, size: 8, color: colors.ink }, hoverinfo: "skip" });
        }
      }
      if (known) shown.filter((z) => real.includes(z)).forEach((z, i) => step([...known.time, page.content.end], [...known.values.map((row) => 100 * row[z]), 100 * known.values[known.values.length - 1][z]],
        { line: { color: colors.lines[i], width: 1.6, dash: "dash" }, rest: { name: `zone ${z + 1}, true` } }));
      if (findings.length) data.push({ type: "scatter", mode: "markers", x: findings.map((each) => each.onset), y: findings.map(() => 0), name: "onset, twin",
        error_x: { type: "data", array: findings.map((each) => 2 * each.onset_deviation), color: colors.alarm }, cliponaxis: false, marker: { symbol: "diamond", size: 11, color: colors.alarm } });
      if (alarms.length) data.push({ type: "scatter", mode: "lines", x: [null], y: [null], name: "alarm, twin", line: { color: colors.alarm, width: 2, dash: "dashdot" } });
      const shapes = alarms.map((x) => ({ type: "line", xref: "x", yref: "paper", x0: x, x1: x, y0: 0, y1: 1, line: { color: colors.alarm, width: 2, dash: "dashdot" } }));
      return { data, more: { shapes, xaxis: axis(colors, "time [s]"), yaxis: axis(colors, "damage [%]", { rangemode: "tozero" }), hovermode: "closest" } };
    },
  });
}

// chi2 of the twin per sample, and its score of new damage, at the end of each of its windows.
function addTwin() {
  const { time, misfit, score, alarms } = page.content.watch || {};
  if (!time || !time.length) return;
  addFigure({
    title: "Misfit of the digital twin", timed: true, note: "At the end of each of its windows: chi2 per sample, 1 where it explains the record, and the score of new damage over its mean.",
    make(colors) {
      const mode = time.length > MOST_MARKERS ? "lines" : "lines+markers";
      const line = (y, name, color) => ({ type: "scatter", mode, x: time, y, name, cliponaxis: false, line: { color } });
      const shapes = (alarms || []).map((x) => ({ type: "line", xref: "x", yref: "paper", x0: x, x1: x, y0: 0, y1: 1, line: { color: colors.alarm, width: 2, dash: "dashdot" } }));
      return { data: [line(misfit, "chi2 per sample", colors.lines[0]), line(score, "score of new damage", colors.lines[1])],
        more: { shapes, xaxis: axis(colors, "time [s]"), yaxis: axis(colors, "[1]", { type: "log", exponentformat: "power" }) } };
    },
  });
}

function addLikeness() {
  const found = page.content.damage && page.content.damage.windows;
  if (!found || !found.likeness || !stated(Array.from(found.likeness_values))) return;
  const misfit = found.likeness === "misfit", limit = misfit ? 1 : 0.5;
  addFigure({
    title: misfit ? "Misfit with what the detector was trained on" : "Similarity with what the detector was trained on", timed: true,
    note: `A judgement is valid ${misfit ? "up to" : "from"} ${limit}.`,
    make(colors) {
      const data = [{ type: "scatter", mode: found.time.length > MOST_MARKERS ? "lines" : "lines+markers", x: found.time, y: found.likeness_values, name: found.likeness, cliponaxis: false, line: { color: colors.lines[0] } }];
      const shapes = [{ type: "line", xref: "paper", yref: "y", x0: 0, x1: 1, y0: limit, y1: limit, line: { color: colors.alarm, width: 1.5, dash: "dash" } }];
      return { data, more: { shapes, showlegend: false, xaxis: axis(colors, "time [s]"), yaxis: axis(colors, `${found.likeness} [1]`, { rangemode: "tozero" }) } };
    },
  });
}

// The chance that the detector states of being far off, at the end of each of its windows.
function addRisk() {
  const found = page.content.damage && page.content.damage.windows;
  if (!found || !stated(Array.from(found.risk))) return;
  addFigure({
    title: "Risk that the detector is wrong", timed: true, note: "The chance that some zone is wrong by more than 10 % of its stiffness; a judgement is valid up to 1 %.",
    make(colors) {
      const data = [{ type: "scatter", mode: found.time.length > MOST_MARKERS ? "lines" : "lines+markers", x: found.time, y: percent(found.risk), name: "risk", cliponaxis: false, line: { color: colors.lines[0] } }];
      const shapes = [{ type: "line", xref: "paper", yref: "y", x0: 0, x1: 1, y0: 1, y1: 1, line: { color: colors.alarm, width: 1.5, dash: "dash" } }];
      return { data, more: { shapes, showlegend: false, xaxis: axis(colors, "time [s]"), yaxis: axis(colors, "risk [%]", { rangemode: "tozero" }) } };
    },
  });
}

function addIndices() {
  const found = page.content.damage && page.content.damage.windows;
  if (!found || !found.index) return;
  const base = found.index[0], rows = Array.from(base.keys());
  addFigure({
    title: "Packet energies over those of the first window", timed: true, note: "One row for each index of the detector; 1 is no change.",
    make(colors) {
      const z = rows.map((row) => found.index.map((values) => values[row] / base[row]));
      const data = [{ type: "heatmap", x: found.time, y: rows.map((row) => row + 1), z, colorscale: "Cividis", colorbar: { thickness: 12 } }];
      return { data, more: { xaxis: axis(colors, "time [s]"), yaxis: axis(colors, "index") } };
    },
  });
}
