"use strict";
const STYLE = {
  truth: {color: "#f2b84b", width: 4.5}, estimate: {color: "#1f5fbf", width: 1.5},
  error: {color: "#b4481f", width: 1.3}, reference: {color: "#8a95a3", width: 1.5, dash: "dash"},
  limit: {color: "#3d4652", width: 1.3, dash: "dash"}, measured: {color: "#8a95a3", width: 1.2},
  "unit-A": {color: "#d97706", width: 1.4}, "unit-B": {color: "#7c3aed", width: 1.4},
  "unit-C": {color: "#15803d", width: 1.4},
  kxx: {color: "#1f5fbf", width: 1.4}, kyy: {color: "#0e8fa8", width: 1.4},
  kxy: {color: "#15803d", width: 1.4}, dxx: {color: "#b4481f", width: 1.4},
  dyy: {color: "#d97706", width: 1.4}, dxy: {color: "#c02b6f", width: 1.4},
  m: {color: "#7c3aed", width: 1.4},
  before: {color: "#c2571b", width: 1.4}, after: {color: "#1f5fbf", width: 1.5}, run: {color: "#1b2430", width: 2},
  dot: {color: "#1f5fbf", width: 6, dots: true}, bad: {color: "#c81e1e", width: 8, dots: true},
  "effect-0": {color: "#15803d", width: 1.3}, "effect-1": {color: "#7c3aed", width: 1.3},
  "effect-2": {color: "#c02b6f", width: 1.3}, "effect-3": {color: "#0e8fa8", width: 1.3},
};
// White: noise alone. Light to dark keeps its order in grey, too.
const SCALES = {
  gap: [[0, "#ffffff"], [0.12, "#fdf1dc"], [0.3, "#f9c06d"], [0.55, "#d9622b"], [0.8, "#8c1f4f"], [1, "#2b0b3f"]],
  score: [[0, "#ffffff"], [0.5, "#dbe7f8"], [0.8, "#7ea9e1"], [1, "#1f5fbf"]],
};
const STOPS = Object.fromEntries(Object.entries(SCALES).map(([name, scale]) =>
  [name, scale.map(([at, colour]) => [at, [1, 3, 5].map(k => parseInt(colour.slice(k, k + 2), 16))])]));
const touch = matchMedia("(pointer: coarse)").matches;

const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function axis(title, logarithmic, few) {
  return {
    title: {text: title, standoff: 6, font: {size: 12.5}}, type: logarithmic ? "log" : "linear",
    gridcolor: css("--grid"), linecolor: css("--axis"), showline: true, ticks: "outside", ticklen: 4,
    tickcolor: css("--axis"), zeroline: false, automargin: true, nticks: few ? 6 : 0,
    exponentformat: logarithmic ? "power" : "e", minor: {nticks: 0},
  };
}

// Of a logarithmic axis: 1, 2, 5 over few decades, powers over many, as many as `most`. As numbers, for 100m of a second reads as metres or minutes.
function ticks_of(values, most) {
  const shown = values.filter(value => value > 0), low = Math.min(...shown), high = Math.max(...shown);
  const plain = low >= 1e-4 && high < 1e6;
  const decades = Math.log10(high / low);
  return {dtick: decades > 3.5 ? Math.ceil(decades / most) : "D2", ...(plain ? {exponentformat: "none", tickformat: "~r"} : {})};
}

function layout(panel) {
  const shapes = panel.band ? [{
    type: "rect", xref: "x", yref: "paper", x0: 10 ** panel.band[0], x1: 10 ** panel.band[1],
    y0: 0, y1: 1, fillcolor: "#1f5fbf", opacity: 0.07, line: {width: 0}, layer: "below",
  }] : [];
  const y = axis(panel.y_title, panel.y_log, true);
  if (panel.y_range) y.range = panel.y_range;
  if (panel.y_log) Object.assign(y, ticks_of(panel.names ? panel.values : panel.lines.flatMap(line => line.y), 7));
  const x = axis(panel.x_title, panel.x_log, !panel.wide);
  if (panel.floor) shapes.push({
    type: "line", xref: "paper", x0: 0, x1: 1, y0: panel.floor, y1: panel.floor,
    line: {...STYLE.limit, dash: "dash"}, layer: "above",
  });
  if (panel.names || panel.colours === "score") Object.assign(x, {type: "category", showgrid: false, tickangle: panel.names && innerWidth < 620 ? 90 : "auto"});
  if (panel.colours === "score") {
    Object.assign(x, {side: "top", categoryorder: "array", categoryarray: panel.columns, range: [-0.5, panel.columns.length - 0.5]});
    Object.assign(y, {type: "category", showgrid: false, nticks: 0, dtick: 1, tickfont: {size: 11}, ticks: "",
      categoryorder: "array", categoryarray: panel.rows, range: [-0.5, panel.rows.length - 0.5]});
  }
  if (panel.z || panel.levels) Object.assign(x, {showgrid: false}), Object.assign(y, {showgrid: false});
  if (panel.x_log) {
    Object.assign(x, ticks_of(panel.lines.flatMap(line => [line.x[0], line.x[line.x.length - 1]]), panel.wide ? 7 : 4));
  }
  if (panel.x_names?.length) {
    Object.assign(x, {tickmode: "array", tickvals: panel.x_names.map((_, k) => k), ticktext: panel.x_names,
      range: [-0.25, panel.x_names.length - 0.75]});
  }
  return {
    xaxis: x, yaxis: y, shapes, showlegend: false, hovermode: panel.z || panel.names || panel.lines?.some(line => line.text.length) ? "closest" : "x unified",
    margin: {l: 8, r: 12, t: panel.title ? 26 : 10, b: 8}, dragmode: touch ? false : "zoom",
    title: panel.title ? {text: panel.title, font: {size: 13}, x: 0.5, y: 0.98, yanchor: "top"} : undefined,
    font: {family: getComputedStyle(document.body).fontFamily, size: 12, color: css("--ink")},
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    hoverlabel: {font: {size: 12, color: css("--ink")}, bgcolor: css("--paper"), bordercolor: css("--line")},
    images: panel.z || panel.levels ? [picture(panel)] : [],
  };
}

function cells(panel) {
  if (!panel.levels) return panel.z;
  const bytes = Uint8Array.from(atob(panel.levels), letter => letter.charCodeAt(0));
  const [low, high] = panel.z_range, width = panel.columns.length;
  return panel.rows.map((_, row) => Array.from(bytes.subarray(row * width, (row + 1) * width),
    level => Math.round(10 * (low + (high - low) * level / 255)) / 10));
}

// Red, green and blue, 0 to 255, of a value in a map.
function colourOf(value, panel) {
  const [low, high] = panel.z_range, share = Math.min(Math.max((value - low) / (high - low), 0), 1);
  const stops = STOPS[panel.colours];
  const k = Math.max(stops.findIndex(([at]) => at >= share), 1), [a, from] = stops[k - 1], [b, to] = stops[k];
  return from.map((start, n) => Math.round(start + (to[n] - start) * (share - a) / (b - a)));
}

// White or dark, whichever stands out more: their contrasts are equal at a luminance of 0.215 (WCAG 2).
function inkOn(colour) {
  const [r, g, b] = colour.map(part => part > 10 ? ((part / 255 + 0.055) / 1.055) ** 2.4 : part / 255 / 12.92);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b > 0.215 ? "#1b2430" : "#ffffff";
}

// A map is a picture with one pixel a cell; unseen markers carry its colour bar and its hover texts.
function picture(panel) {
  const z = cells(panel);
  const canvas = Object.assign(document.createElement("canvas"), {width: panel.columns.length, height: panel.rows.length});
  const context = canvas.getContext("2d"), image = context.createImageData(canvas.width, canvas.height);
  z.forEach((row, r) => row.forEach((value, c) => {
    if (value === null) return;
    const place = 4 * ((canvas.height - 1 - r) * canvas.width + c);
    colourOf(value, panel).forEach((part, n) => { image.data[place + n] = part; });
    image.data[place + 3] = 255;
  }));
  context.putImageData(image, 0, 0);
  const shown = panel.text.length ? enlarged(canvas) : canvas;
  const [x, width] = extent(panel.columns), [y, height] = extent(panel.rows);
  return {source: shown.toDataURL(), xref: "x", yref: "y", x, y, sizex: width, sizey: height,
    xanchor: "left", yanchor: "bottom", sizing: "stretch", layer: "below"};
}

// The same with cells of many pixels: a browser blurs a few pixels that it stretches into one another.
function enlarged(canvas) {
  const times = length => Math.ceil(1000 / length);
  const large = Object.assign(document.createElement("canvas"),
    {width: canvas.width * times(canvas.width), height: canvas.height * times(canvas.height)});
  const context = large.getContext("2d");
  context.imageSmoothingEnabled = false;
  context.drawImage(canvas, 0, 0, large.width, large.height);
  return large;
}

function extent(values) {
  if (typeof values[0] !== "number") return [-0.5, values.length];
  const step = values.length > 1 ? (values[values.length - 1] - values[0]) / (values.length - 1) : 1;
  return [values[0] - step / 2, step * values.length];
}

function heat(panel) {
  const few = panel.text.length > 0, z = cells(panel), points = {x: [], y: [], value: [], text: [], colour: []};
  panel.rows.forEach((row, r) => panel.columns.forEach((column, c) => {
    if (z[r][c] === null) return;
    points.x.push(column); points.y.push(row); points.value.push(z[r][c]);
    points.text.push(few ? panel.text[r][c] : ""); points.colour.push(inkOn(colourOf(z[r][c], panel)));
  }));
  return [{
    type: "scatter", mode: few ? "text" : "markers", x: points.x, y: points.y, text: points.text, customdata: points.value,
    textfont: {size: 11, color: points.colour},
    marker: {color: points.value, colorscale: SCALES[panel.colours], cmin: panel.z_range[0], cmax: panel.z_range[1],
      opacity: 0, size: 4, showscale: !few,
      colorbar: {title: {text: panel.z_title, font: {size: 12}}, thickness: 10, outlinewidth: 0, len: 1, ticklen: 3}},
    hovertemplate: few ? "%{y}, %{x}: %{text}<extra></extra>" : "%{x} s, %{y}: %{customdata} dB<extra></extra>",
  }];
}

function bars(panel) {
  const named = panel.names.map((name, k) => k < 2 ? STYLE.before.color : STYLE.after.color);
  return [{
    type: "bar", x: panel.names, y: panel.values, marker: {color: named}, width: 0.5, text: panel.texts,
    textposition: "inside", insidetextanchor: "start", textangle: innerWidth < 620 ? -90 : 0, insidetextfont: {color: "#ffffff", size: 13},
    constraintext: "none", hovertemplate: "%{x}: %{y:.4g}<extra></extra>",
  }, ...Object.entries(panel.dots).map(([run, values]) => ({
    type: "scatter", mode: "markers", name: run, x: panel.names, y: values,
    marker: {color: "#1b2430", size: 6, line: {color: "#ffffff", width: 1}}, hovertemplate: run + ": %{y:.4g}<extra></extra>",
  }))];
}

function traces(panel) {
  return panel.z || panel.levels ? heat(panel) : panel.names ? bars(panel) : lines(panel);
}

function lines(panel) {
  return panel.lines.map(line => ({
    type: "scatter", mode: STYLE[line.role].dots ? "markers" : "lines", name: line.name, x: line.x, y: line.y,
    line: STYLE[line.role], marker: {color: STYLE[line.role].color, size: STYLE[line.role].width}, text: line.text,
    connectgaps: false, hovertemplate: line.text.length ? "%{text}: %{y:.4g}<extra></extra>" : "%{y:.4g}",
    hoverinfo: panel.lines.some(other => other.text.length) && !line.text.length ? "skip" : undefined,
  }));
}

// Lines that are black on white are white on black.
function adapt() {
  const own = {run: "--ink", limit: "--soft", estimate: "--accent", dot: "--accent"};
  for (const [role, name] of Object.entries(own)) STYLE[role].color = css(name);
}

const fit = new ResizeObserver(entries => {
  for (const entry of entries) Plotly.Plots.resize(entry.target);
});
const data = JSON.parse(document.getElementById("data").textContent);
function draw() {
  adapt();
  for (const [id, panels] of Object.entries(data)) {
    const places = document.getElementById(id).querySelectorAll(".panel");
    panels.forEach((panel, k) => {
      if (panel.height) places[k].style.height = panel.height + "px";
      Plotly.react(places[k], traces(panel), layout(panel), {displayModeBar: false});
      fit.observe(places[k]);
    });
  }
  for (const mark of document.querySelectorAll("[data-role]")) {
    const style = STYLE[mark.dataset.role], stroke = mark.firstElementChild;
    stroke.setAttribute("stroke", style.color);
    stroke.setAttribute("stroke-width", Math.max(2, style.width));
    if (style.dots) { stroke.setAttribute("stroke-linecap", "round"); stroke.setAttribute("x1", 12); stroke.setAttribute("x2", 12); }
    if (style.dash) stroke.setAttribute("stroke-dasharray", "5 3");
  }
}
draw();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
// Paper is white, and narrower than most windows.
matchMedia("print").addEventListener("change", () => { draw(); for (const place of document.querySelectorAll(".panel")) Plotly.Plots.resize(place); });
document.documentElement.dataset.drawn = "yes";
