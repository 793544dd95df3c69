"use strict";
// Canvases: axes, lines, the orbit, and a Fourier transform to draw spectra by.

const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// A canvas with as many pixels as the screen has in its place, drawn in CSS pixels.
function fitted(canvas) {
  const scale = Math.min(devicePixelRatio || 1, 2);
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale), canvas.height = Math.round(height * scale);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  return {pen, width, height};
}

// Round numbers between low and high, some `wanted` of them.
function ticks(low, high, wanted) {
  const raw = (high - low) / wanted, decade = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find(m => m * decade >= raw) * decade;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}

const plain = number => String(Number(number.toPrecision(6)));

// Lines {x, y, color, width} over axes {low, high, title, log}; log: the numbers are powers of ten.
function chart(canvas, x, y, lines) {
  const {pen, width, height} = fitted(canvas);
  const left = 46, right = 10, top = 10, bottom = 34;
  const across = v => left + (v - x.low) / (x.high - x.low) * (width - left - right);
  const up = v => height - bottom - (v - y.low) / (y.high - y.low) * (height - top - bottom);
  pen.font = "12px system-ui, sans-serif";
  pen.lineWidth = 1;
  for (const v of ticks(x.low, x.high, Math.max(3, width / 90))) {
    pen.strokeStyle = css("--grid"), pen.fillStyle = css("--soft"), pen.textAlign = "center";
    pen.beginPath(), pen.moveTo(across(v), top), pen.lineTo(across(v), height - bottom), pen.stroke();
    pen.fillText(plain(v), across(v), height - bottom + 15);
  }
  for (const v of ticks(y.low, y.high, 4)) {
    if (y.log && !Number.isInteger(v)) continue;
    pen.strokeStyle = css("--grid"), pen.fillStyle = css("--soft"), pen.textAlign = "right";
    pen.beginPath(), pen.moveTo(left, up(v)), pen.lineTo(width - right, up(v)), pen.stroke();
    pen.fillText(!y.log ? plain(v) : Math.abs(v) > 2 ? `1e${v}` : plain(10 ** v), left - 6, up(v) + 4);
  }
  pen.textAlign = "right";
  pen.fillText(x.title, width - right, height - 4);
  pen.save();
  pen.beginPath(), pen.rect(left, top, width - left - right, height - top - bottom), pen.clip();
  for (const line of lines) {
    pen.strokeStyle = line.color, pen.lineWidth = line.width || 1.5, pen.lineJoin = "round";
    pen.setLineDash(line.dash || []);
    pen.beginPath();
    for (let k = 0; k < line.x.length; k++) {
      if (Number.isFinite(line.y[k])) pen.lineTo(across(line.x[k]), up(line.y[k]));
    }
    pen.stroke();
  }
  pen.restore();
}

// Fourier transform in place; re.length is a power of two.
function transform(re, im) {
  const n = re.length;
  for (let i = 1, j = 0; i < n; i++) {
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) [re[i], re[j]] = [re[j], re[i]], [im[i], im[j]] = [im[j], im[i]];
  }
  for (let half = 1; half < n; half *= 2) {
    for (let k = 0; k < half; k++) {
      const c = Math.cos(Math.PI * k / half), s = -Math.sin(Math.PI * k / half);
      for (let i = k; i < n; i += 2 * half) {
        const j = i + half, a = c * re[j] - s * im[j], b = c * im[j] + s * re[j];
        re[j] = re[i] - a, im[j] = im[i] - b, re[i] += a, im[i] += b;
      }
    }
  }
}

// Two real signals {re, im} under a Hann window: log10 of the amplitude of each, up to frequency `most`, `rate` samples a second.
function spectra(first, second, rate, most) {
  const n = first.length, re = new Float64Array(n), im = new Float64Array(n);
  for (let k = 0; k < n; k++) {
    const window = 1 - Math.cos(2 * Math.PI * k / n);
    re[k] = first[k] * window, im[k] = second[k] * window;
  }
  transform(re, im);
  const last = Math.min(n / 2 - 1, Math.floor(most / rate * n));
  const f = [], x = [], y = [];
  for (let k = 1; k <= last; k++) {
    // Both signals in one transform: even and odd parts of it.
    const a = re[k] + re[n - k], b = im[k] - im[n - k], c = im[k] + im[n - k], d = re[n - k] - re[k];
    f.push(k * rate / n);
    x.push(Math.log10(Math.hypot(a, b) / n + 1e-12));
    y.push(Math.log10(Math.hypot(c, d) / n + 1e-12));
  }
  return {f, x, y};
}

// The trail of the orbit, new parts bright; `ghost`: that of the ideal device; reach [V]: from the centre to the edge.
function drawOrbit(canvas, trail, ghost, reach, held) {
  const {pen, width, height} = fitted(canvas);
  const middle = {x: width / 2, y: height / 2}, scale = 0.46 * Math.min(width, height) / reach;
  const place = (x, y) => [middle.x + scale * x, middle.y - scale * y];
  pen.strokeStyle = css("--grid"), pen.fillStyle = css("--soft"), pen.lineWidth = 1, pen.font = "12px system-ui, sans-serif";
  for (const v of ticks(0, reach, 3).slice(1)) {
    pen.beginPath(), pen.arc(middle.x, middle.y, scale * v, 0, 2 * Math.PI), pen.stroke();
    pen.textAlign = "left", pen.fillText(`${plain(v)} V`, middle.x + scale * v * 0.71 + 3, middle.y + scale * v * 0.71 + 10);
  }
  pen.beginPath(), pen.moveTo(middle.x, 0), pen.lineTo(middle.x, height), pen.moveTo(0, middle.y), pen.lineTo(width, middle.y), pen.stroke();
  pen.textAlign = "right", pen.fillText("x", width - 4, middle.y - 6);
  pen.textAlign = "left", pen.fillText("y", middle.x + 6, 12);
  pen.lineJoin = "round";
  if (ghost) curve(pen, ghost, place, css("--ghost"), 1, 0.6);
  curve(pen, trail, place, css("--glow"), 1.8, 1);
  const end = held || trail.last;
  if (end) {
    const [x, y] = place(...end);
    pen.globalAlpha = 1, pen.fillStyle = css("--mass"), pen.beginPath(), pen.arc(x, y, 8, 0, 2 * Math.PI), pen.fill();
    if (held) pen.strokeStyle = css("--mass"), pen.lineWidth = 1.5, pen.beginPath(), pen.moveTo(middle.x, middle.y), pen.lineTo(x, y), pen.stroke();
  }
  return {x: p => (p - middle.x) / scale, y: p => (middle.y - p) / scale};
}

const FADES = 12;

function curve(pen, trail, place, color, width, strength) {
  pen.strokeStyle = color, pen.lineWidth = width;
  const part = Math.ceil(trail.count / FADES), stride = Math.min(Math.ceil(trail.count / 6000), 3);
  for (let fade = 0; fade < FADES; fade++) {
    pen.globalAlpha = strength * ((fade + 1) / FADES) ** 1.6;
    pen.beginPath();
    for (let k = fade * part; k <= Math.min((fade + 1) * part, trail.count - 1); k += stride) pen.lineTo(...place(...trail.at(k)));
    pen.stroke();
  }
  pen.globalAlpha = 1;
}
