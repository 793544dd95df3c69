"use strict";
const STYLE = {
  truth: {color: "#f2b84b", width: 4.5}, estimate: {color: "#1f5fbf", width: 1.5},
  error: {color: "#b4481f", width: 1.3}, reference: {color: "#8a95a3", width: 1.5, dash: "dash"},
  limit: {color: "#3d4652", width: 1.3, dash: "dash"},
  "unit-A": {color: "#d97706", width: 1.4}, "unit-B": {color: "#7c3aed", width: 1.4},
  "unit-C": {color: "#15803d", width: 1.4},
  kxx: {color: "#1f5fbf", width: 1.4}, kyy: {color: "#0e8fa8", width: 1.4},
  kxy: {color: "#15803d", width: 1.4}, dxx: {color: "#b4481f", width: 1.4},
  dyy: {color: "#d97706", width: 1.4}, dxy: {color: "#c02b6f", width: 1.4},
  m: {color: "#7c3aed", width: 1.4},
  before: {color: "#c2571b", width: 1.4}, after: {color: "#1f5fbf", width: 1.5}, run: {color: "#1b2430", width: 2},
  "effect-0": {color: "#15803d", width: 1.3}, "effect-1": {color: "#7c3aed", width: 1.3},
  "effect-2": {color: "#c02b6f", width: 1.3}, "effect-3": {color: "#0e8fa8", width: 1.3},
};
// White: noise alone. Light to dark keeps its order in grey, too.
const SCALES = {
  gap: [[0, "#ffffff"], [0.12, "#fdf1dc"], [0.3, "#f9c06d"], [0.55, "#d9622b"], [0.8, "#8c1f4f"], [1, "#2b0b3f"]],
  score: [[0, "#ffffff"], [0.5, "#dbe7f8"], [0.8, "#7ea9e1"], [1, "#1f5fbf"]],
};
const touch = matchMedia("(pointer: coarse)").matches;

function axis(title, logarithmic, few) {
  return {
    title: {text: title, standoff: 6, font: {size: 12.5}}, type: logarithmic ? "log" : "linear",
    gridcolor: "#e9edf1", linecolor: "#c3cad3", showline: true, ticks: "outside", ticklen: 4,
    tickcolor: "#c3cad3", zeroline: false, automargin: true, nticks: few ? 6 : 0,
    exponentformat: logarithmic ? "power" : "e", minor: {nticks: 0},
  };
}

function layout(panel) {
  const shapes = panel.band ? [{
    type: "rect", xref: "x", yref: "paper", x0: 10 ** panel.band[0], x1: 10 ** panel.band[1],
    y0: 0, y1: 1, fillcolor: "#1f5fbf", opacity: 0.07, line: {width: 0}, layer: "below",
  }] : [];
  const y = axis(panel.y_title, panel.y_log, true);
  if (panel.y_range) y.range = panel.y_range;
  if (panel.y_log) y.dtick = 1;
  const x = axis(panel.x_title, panel.x_log, !panel.wide);
  if (panel.floor) shapes.push({
    type: "line", xref: "paper", x0: 0, x1: 1, y0: panel.floor, y1: panel.floor,
    line: {...STYLE.limit, dash: "dash"}, layer: "above",
  });
  if (panel.names || panel.colours === "score") Object.assign(x, {type: "category", showgrid: false, tickangle: panel.names && innerWidth < 620 ? 90 : "auto"});
  if (panel.colours === "score") {
    Object.assign(x, {side: "top"});
    Object.assign(y, {type: "category", showgrid: false, nticks: 0, dtick: 1, tickfont: {size: 11}, ticks: ""});
  }
  if (panel.x_log) {
    const shown = panel.lines.flatMap(line => [line.x[0], line.x[line.x.length - 1]]);
    const decades = Math.log10(Math.max(...shown) / Math.min(...shown));
    Object.assign(x, {tickformat: "~s", dtick: decades > 3.5 ? 1 : "D2"});
  }
  return {
    xaxis: x, yaxis: y, shapes, showlegend: false, hovermode: panel.z || panel.names ? "closest" : "x unified",
    margin: {l: 8, r: 12, t: panel.title ? 26 : 10, b: 8}, dragmode: touch ? false : "zoom",
    title: panel.title ? {text: panel.title, font: {size: 13}, x: 0.5, y: 0.98, yanchor: "top"} : undefined,
    font: {family: getComputedStyle(document.body).fontFamily, size: 12, color: "#1b2430"},
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    hoverlabel: {font: {size: 12}},
  };
}

function cells(panel) {
  if (!panel.levels) return panel.z;
  const bytes = Uint8Array.from(atob(panel.levels), letter => letter.charCodeAt(0));
  const [low, high] = panel.z_range, width = panel.columns.length;
  return panel.rows.map((_, row) => Array.from(bytes.subarray(row * width, (row + 1) * width),
    level => Math.round(10 * (low + (high - low) * level / 255)) / 10));
}

function heat(panel) {
  const few = panel.text.length > 0;
  return [{
    type: "heatmap", x: panel.columns, y: panel.rows, z: cells(panel), zmin: panel.z_range[0], zmax: panel.z_range[1],
    colorscale: SCALES[panel.colours], xgap: few ? 3 : 0, ygap: few ? 2 : 0, hoverongaps: false,
    text: few ? panel.text : undefined, texttemplate: few ? "%{text}" : undefined, textfont: {size: 11}, showscale: !few,
    hovertemplate: few ? "%{y}, %{x}: %{text}<extra></extra>" : "%{x} s, %{y}: %{z} dB<extra></extra>",
    colorbar: {title: {text: panel.z_title, font: {size: 12}}, thickness: 10, outlinewidth: 0, len: 1, ticklen: 3},
  }];
}

function bars(panel) {
  const named = panel.names.map((name, k) => k < 2 ? STYLE.before.color : STYLE.after.color);
  return [{
    type: "bar", x: panel.names, y: panel.values, marker: {color: named}, width: 0.5, text: panel.texts,
    textposition: "inside", insidetextanchor: "start", textangle: 0, insidetextfont: {color: "#ffffff", size: 13},
    constraintext: "none", hovertemplate: "%{x}: %{y:.4g}<extra></extra>",
  }, ...Object.entries(panel.dots).map(([run, values]) => ({
    type: "scatter", mode: "markers", name: run, x: panel.names, y: values,
    marker: {color: "#1b2430", size: 6, line: {color: "#ffffff", width: 1}}, hovertemplate: run + ": %{y:.4g}<extra></extra>",
  }))];
}

function traces(panel) {
  return panel.z ? heat(panel) : panel.names ? bars(panel) : lines(panel);
}

function lines(panel) {
  return panel.lines.map(line => ({
    type: "scatter", mode: "lines", name: line.name, x: line.x, y: line.y, line: STYLE[line.role],
    connectgaps: false, hovertemplate: "%{y:.4g}",
  }));
}

const fit = new ResizeObserver(entries => {
  for (const entry of entries) Plotly.Plots.resize(entry.target);
});
const data = JSON.parse(document.getElementById("data").textContent);
for (const [id, panels] of Object.entries(data)) {
  const places = document.getElementById(id).querySelectorAll(".panel");
  panels.forEach((panel, k) => {
    if (panel.height) places[k].style.height = panel.height + "px";
    Plotly.newPlot(places[k], traces(panel), layout(panel), {displayModeBar: false});
    fit.observe(places[k]);
  });
}
for (const mark of document.querySelectorAll("[data-role]")) {
  const style = STYLE[mark.dataset.role], stroke = mark.firstElementChild;
  stroke.setAttribute("stroke", style.color);
  stroke.setAttribute("stroke-width", Math.max(2, style.width));
  if (style.dash) stroke.setAttribute("stroke-dasharray", "5 3");
}
