"use strict";
// The game: a device with an effect that is hidden by a number, a model that the sliders change, and what is left between them.

const SHOWN_TO = 4;  // spectra end at so many times the lowest mode

// A generator of numbers from 0 to 1 by a whole seed (mulberry32), so that a case is the same everywhere.
function generator(seed) {
  return () => {
    seed = (seed + 0x6d2b79f5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

// What case `number` hides: effect, parameter and value in SI.
function hiddenIn(number, hideable) {
  const random = generator(number), effects = [...new Set(hideable.map(range => range.effect))];
  const effect = effects[Math.floor(random() * effects.length)];
  const ranges = hideable.filter(range => range.effect === effect);
  const range = ranges[Math.floor(random() * ranges.length)];
  const size = Number((range.low * (range.high / range.low) ** random()).toPrecision(3));
  return {effect, name: range.name, value: range.signed && random() < 0.5 ? -size : size};
}

// What hides and diagnoses the same case on a command line.
function commandsFor(number, hidden, experiment, device) {
  return `gyrotwin dataset simulate case-${number} --device ${device} --samples ${experiment.samples} --set ${hidden.name}=${hidden.value}\n`
    + `gyrotwin diagnose case-${number}`;
}

// The run of the experiment on the FMU: each sample's voltages [V], NaN once the motion diverges.
class Bench {
  constructor(module, data) {
    this.data = data;
    this.fmu = new FmuInstance(module);
    this.inputs = new Variables(module, [data.references.u_x, data.references.u_y, data.references.omega_z]);
    this.outputs = new Variables(module, [data.references.v_x, data.references.v_y]);
    const {experiment} = data, step = 1 / experiment.rate;
    this.force = [0, 1].map(axis => Float64Array.from({length: experiment.samples}, (_, k) => experiment.size
      * experiment.frequency[axis].reduce((sum, f, i) => sum + Math.sin(2 * Math.PI * f * k * step + experiment.phase[axis][i]), 0)));
  }

  record(numbers) {
    const {experiment, whole} = this.data, step = 1 / experiment.rate;
    const v = {x: new Float64Array(experiment.samples).fill(NaN), y: new Float64Array(experiment.samples).fill(NaN)};
    const all = new Map([...numbers, [this.data.references.omega_z, experiment.omega_z],
      [this.data.references.u_x, this.force[0][0]], [this.data.references.u_y, this.force[1][0]]]);
    let going = this.fmu.start(all, [...whole, [this.data.references.seed, experiment.seed]]);
    for (let k = 0; going && k < experiment.samples; k++) {
      this.outputs.get(this.fmu.handle);
      v.x[k] = this.outputs.values[0], v.y[k] = this.outputs.values[1];
      const values = this.inputs.values;
      values[0] = this.force[0][k], values[1] = this.force[1][k], values[2] = experiment.omega_z;
      going = this.inputs.set(this.fmu.handle) && this.fmu.step(k * step, step);
    }
    return v;
  }
}

const rms = (...signals) => Math.sqrt(signals.reduce((sum, s) => sum + s.reduce((part, v) => part + v * v, 0), 0) / signals[0].length);
const less = (a, b) => a.map((v, k) => v - b[k]);

class Game {
  constructor(module, data, controls) {
    Object.assign(this, {data, controls, bench: new Bench(module, data), cases: 0, right: 0});
    this.at = id => document.getElementById(id);
    this.known = new Map(data.experiment.known);
    this.device = new Map(data.experiment.device);
    for (const range of data.hideable) if (!this.at("guess").namedItem(range.effect)) {
      const option = new Option(data.effects[range.effect].title, range.effect);
      option.id = range.effect;
      this.at("guess").add(option);
    }
    this.at("guess").addEventListener("change", () => this.suspect());
    this.at("next").addEventListener("click", () => this.open(this.number + 1));
    this.at("case").addEventListener("change", () => this.open(Math.max(1, Math.floor(this.at("case").valueAsNumber) || 1)));
    this.at("answer").addEventListener("click", () => this.answer());
    this.at("reveal").addEventListener("click", () => this.reveal("Not guessed."));
  }

  open(number) {
    this.number = number, this.done = false;
    this.at("case").value = number;
    this.hidden = hiddenIn(number, this.data.hideable);
    this.measured = this.bench.record(new Map([...this.device, [this.data.references[this.hidden.name], this.hidden.value]]));
    this.at("verdict").textContent = "", this.at("commands").hidden = true, this.at("commands").textContent = "";
    this.at("guess").value = "";
    this.largest = undefined;
    this.suspect();
  }

  // The sliders of the effect that is suspected, as a model of the user's.
  suspect() {
    const id = this.at("guess").value, place = this.at("suspected");
    this.model = new Map(this.known);
    place.replaceChildren();
    this.at("signature").textContent = id ? `What to look for: ${this.data.effects[id].signature}.` : "Each effect leaves its own trace. Choose one, and its sliders appear.";
    for (const slider of id ? this.data.effects[id].sliders : []) {
      const {row, bind} = this.controls.row(slider, "model");
      place.append(row);
      bind(this.model.get(slider.reference) ?? slider.neutral, value => { this.model.set(slider.reference, value), this.later(); });
    }
    this.at("answer").disabled = !id || this.done;
    this.compare();
  }

  later() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false, this.compare(); });
  }

  compare() {
    const v = this.bench.record(this.model);
    const x = less(this.measured.x, v.x), y = less(this.measured.y, v.y);
    this.misfit = rms(x, y) / rms(this.measured.x, this.measured.y);
    this.at("misfit").textContent = Number.isFinite(this.misfit) ? `${plain(Number((100 * this.misfit).toPrecision(3)))} %` : "the motion diverges";
    this.residual = {x, y};
    this.draw();
  }

  draw() {
    if (!this.residual) return;
    const {x, y} = this.residual, {experiment} = this.data, ms = Array.from(x, (_, k) => 1e3 * k / experiment.rate);
    const top = Math.max(...[x, y].flatMap(s => Array.from(s, Math.abs)).filter(Number.isFinite), 1e-9);
    this.largest ??= top;
    const reach = 1.05 * Math.max(this.largest, Number.isFinite(top) ? Math.min(top, 3 * this.largest) : 0);
    const colors = [css("--glow"), css("--second")];
    chart(this.at("residual"), {low: 0, high: 1e3 * experiment.samples / experiment.rate, title: "t [ms]"}, {low: -reach, high: reach},
      [x, y].map((s, i) => ({x: ms, y: s, color: colors[i], width: 1})));
    const n = 2 ** Math.floor(Math.log2(experiment.samples)), most = SHOWN_TO * this.data.frequency;
    const of = (a, b) => spectra(a.subarray(0, n), b.subarray(0, n), experiment.rate, most);
    const voltage = of(this.measured.x, this.measured.y), left = of(x, y), khz = left.f.map(f => f / 1e3);
    chart(this.at("residual-spectrum"), {low: 0, high: most / 1e3, title: "f [kHz]"}, {low: -6, high: 1, log: true}, [
      {x: khz, y: voltage.x.map((v, k) => Math.max(v, voltage.y[k])), color: css("--ghost"), width: 1.2},
      {x: khz, y: left.x, color: colors[0]}, {x: khz, y: left.y, color: colors[1]},
    ]);
  }

  answer() {
    const right = this.at("guess").value === this.hidden.effect;
    this.cases += 1, this.right += right ? 1 : 0;
    this.reveal(right ? "Right." : "No.");
  }

  reveal(judged) {
    this.done = true, this.at("answer").disabled = true;
    const {effect, name, value} = this.hidden, slider = this.data.effects[effect].sliders.find(s => s.name === name);
    this.at("verdict").textContent = `${judged} Case ${this.number} hides ${effect}: ${name} = ${this.controls.shown(slider, value)}.`
      + (this.cases ? ` ${this.right} of ${this.cases} right.` : "");
    this.at("commands").textContent = commandsFor(this.number, this.hidden, this.data.experiment, this.data.device);
    this.at("commands").hidden = false;
  }
}
