"use strict";
// The page: two FMUs that run beside one another, the device with what the sliders say and the ideal one, drawn as they move.

const data = JSON.parse(document.getElementById("data").textContent);
const BUDGET = 12;            // ms of a frame for the FMU
const LENGTH = 16384;         // samples in a spectrum
const MOST_SWINGS = 3000;     // points of a ring-down before every other one goes
const TRAIL_TIME = 1.5;       // s on the screen that the orbit stays
const FEWEST = 16;            // samples that tell an orbit
const STILL = 0.05;           // share of the first swing at which the mass is plucked again
const at = id => document.getElementById(id);
const step = data.step;
let scene, player, game;

// ---- sliders: the way along one, as a value in SI and back

const controls = {
  along(s, value) {
    if (s.scale === "cubic") return Math.cbrt(value / Math.max(Math.abs(s.low), Math.abs(s.high)));
    if (s.scale === "limit" && value > s.high) return Math.log10(s.high) + 0.01;
    return s.scale === "linear" ? value : Math.log10(value);
  },

  value(s, along) {
    const whole = Math.max(Math.abs(s.low), Math.abs(s.high));
    if (s.scale === "limit" && along > Math.log10(s.high) + 0.005) return s.neutral;
    // The middle is zero, not what rounding of the way makes of it.
    const raw = s.scale === "cubic" ? (Math.abs(along) < 1e-6 ? 0 : whole * along ** 3) : s.scale === "linear" ? along : 10 ** along;
    return Math.min(Math.max(Number(raw.toPrecision(3)), s.low), s.high);
  },

  shown(s, value) {
    if (s.scale === "limit" && value > s.high) return "no limit";
    const number = value * s.factor + s.offset, size = Math.abs(number);
    const text = number !== 0 && (size >= 1e5 || size < 1e-3) ? number.toExponential(2).replace("e+", "e") : plain(Number(number.toPrecision(4)));
    return s.unit ? `${text} ${s.unit}` : text;
  },

  // A labelled slider for `s`; bind(value, changed) sets it and calls changed(value in SI) at each move.
  row(s, kind) {
    const row = at("slider").content.firstElementChild.cloneNode(true);
    const [label, input, output] = [row.querySelector("label"), row.querySelector("input"), row.querySelector("output")];
    input.id = `${kind}-${s.name}`, input.dataset.name = s.name;
    label.htmlFor = output.htmlFor = input.id;
    label.textContent = s.label;
    label.append(Object.assign(document.createElement("code"), {textContent: s.name}));
    [input.min, input.max] = [this.along(s, s.low), s.scale === "limit" ? Math.log10(s.high) + 0.01 : this.along(s, s.high)];
    input.step = "any";
    const put = value => {
      const text = this.shown(s, value);
      output.textContent = text;
      input.setAttribute("aria-valuetext", text);
    };
    const bind = (value, changed) => {
      input.step = (input.max - input.min) / 400;
      input.value = this.along(s, value);
      put(value);
      input.oninput = () => { const v = this.value(s, Number(input.value)); put(v), changed(v); };
    };
    return {row, bind};
  },
};

// ---- what is remembered of a motion, to be drawn

class Motion {
  constructor(module) {
    this.fmu = new FmuInstance(module);
    const r = data.references;
    this.force = new Variables(module, [r.u_x, r.u_y]);
    this.voltage = new Variables(module, [r.v_x, r.v_y]);
    this.state = new Variables(module, [r.x, r.y, r.x_dot, r.y_dot]);
    this.x = new Float64Array(LENGTH), this.y = new Float64Array(LENGTH);
  }

  begin(numbers, whole) {
    this.samples = 0;
    return this.fmu.start(numbers, whole);
  }

  // One sample on, under the force u.
  step(u, forced) {
    if (forced) {
      const values = this.force.values;
      values[0] = u[0], values[1] = u[1];
      this.force.set(this.fmu.handle);
    }
    if (!(this.fmu.step(this.samples * step, step) && this.voltage.get(this.fmu.handle))) return false;
    const k = this.samples++ % LENGTH;
    this.x[k] = this.voltage.values[0], this.y[k] = this.voltage.values[1];
    return true;
  }

  // The last `count` samples, oldest first.
  trail(count) {
    const n = Math.min(count, this.samples, LENGTH), from = this.samples - n;
    const get = k => [this.x[(from + k) % LENGTH], this.y[(from + k) % LENGTH]];
    return {count: n, at: get, last: n ? get(n - 1) : null};
  }

  // The last samples in order, zero before the first.
  ordered() {
    const k = this.samples % LENGTH;
    return this.samples < LENGTH ? [this.x.slice().fill(0, k), this.y.slice().fill(0, k)]
      : [this.x, this.y].map(s => Float64Array.from({length: LENGTH}, (_, i) => s[(k + i) % LENGTH]));
  }
}

// Of each swing: the long and the short radius of the orbit and the angle of the long one, by second moments.
class Swings {
  constructor() { this.clear(); }

  clear() {
    Object.assign(this, {t: [], long: [], short: [], angle: [], every: 1, passed: 0, n: 0, sums: [0, 0, 0, 0, 0]});
  }

  add(x, y, t) {
    const s = this.sums;
    s[0] += x, s[1] += y, s[2] += x * x, s[3] += y * y, s[4] += x * y;
    if (++this.n < FEWEST || this.n * step * data.frequency < 1) return;
    const mx = s[0] / this.n, my = s[1] / this.n;
    const a = s[2] / this.n - mx * mx, b = s[3] / this.n - my * my, c = s[4] / this.n - mx * my;
    const half = Math.hypot((a - b) / 2, c), angle = 90 / Math.PI * Math.atan2(2 * c, a - b);
    this.sums = [0, 0, 0, 0, 0], this.n = 0;
    const before = this.latest?.angle ?? angle;
    // An axis has no sign: the angle goes on by less than a quarter turn.
    const turned = before + ((angle - before) % 180 + 270) % 180 - 90;
    this.latest = {long: Math.sqrt(Math.max(a + b + 2 * half, 0)), short: Math.sqrt(Math.max(a + b - 2 * half, 0)), angle: turned};
    if (this.passed++ % this.every) return;
    this.t.push(t), this.long.push(Math.log10(this.latest.long + 1e-9)), this.short.push(Math.log10(this.latest.short + 1e-9)), this.angle.push(turned);
    if (this.t.length > MOST_SWINGS) {
      for (const name of ["t", "long", "short", "angle"]) this[name] = this[name].filter((_, k) => k % 2 === 0);
      this.every *= 2;
    }
  }
}

class Scene {
  constructor(module) {
    this.device = new Motion(module), this.ideal = new Motion(module);
    this.swings = new Swings(), this.ideally = new Swings();
    this.numbers = new Map(data.numbers), this.idealNumbers = new Map(data.ideal);
    this.whole = data.whole, this.running = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.owed = 0, this.time = 0, this.tone = data.frequency;
    this.pluck();
  }

  set(slider, value) {
    this.numbers.set(slider.reference, value);
    if (!slider.effect) this.idealNumbers.set(slider.reference, value);
    if (!slider.tunable) return slider.name.endsWith("_start") ? this.pluck() : this.goOn();
    this.device.fmu.set(slider.reference, value);
    if (!slider.effect) this.ideal.fmu.set(slider.reference, value);
  }

  // Both start anew at x_start, y_start.
  pluck() {
    const starts = [data.references.x_start, data.references.y_start];
    this.time = 0, this.first = Math.hypot(...starts.map((start, i) => this.numbers.get(start) * data.gains[i]));
    this.swings.clear(), this.ideally.clear();
    delete this.swings.latest, delete this.ideally.latest;
    this.begin(this.numbers, this.idealNumbers);
  }

  // A parameter that is fixed while the FMU runs: both start anew where they are.
  goOn() {
    const moved = (motion, numbers) => {
      motion.state.get(motion.fmu.handle);
      const r = data.references, places = [r.x_start, r.y_start, r.x_dot_start, r.y_dot_start];
      return new Map([...numbers, ...places.map((place, i) => [place, motion.state.values[i]])]);
    };
    this.begin(moved(this.device, this.numbers), moved(this.ideal, this.idealNumbers));
  }

  begin(numbers, ideal) {
    this.broken = !(this.device.begin(numbers, this.whole) && this.ideal.begin(ideal, this.whole));
    say(this.broken ? "The FMU refuses these values: move a slider back, then pluck." : "");
  }

  // n samples on; false where the motion diverges.
  advance(n) {
    const size = [this.numbers.get(data.references.u_x), this.numbers.get(data.references.u_y)], u = [0, 0];
    const forced = size[0] !== 0 || size[1] !== 0;
    for (let i = 0; i < n; i++) {
      const wave = Math.cos(2 * Math.PI * this.tone * this.time);
      u[0] = size[0] * wave, u[1] = size[1] * wave;
      if (!(this.device.step(u, forced) && this.ideal.step(u, forced)) || this.swings.latest?.long > data.beyond) {
        this.broken = true;
        say("The motion diverged: it left what this model describes. Move a slider back, then pluck.");
        return false;
      }
      this.time += step;
      const k = (this.device.samples - 1) % LENGTH;
      this.swings.add(this.device.x[k], this.device.y[k], this.time);
      this.ideally.add(this.ideal.x[k], this.ideal.y[k], this.time);
    }
    return true;
  }
}

const say = text => { if (at("said").textContent !== text) at("said").textContent = text; };

// ---- drawing and the clock

class Player {
  constructor(scene) {
    this.scene = scene, this.frames = 0, this.busy = 0, this.simulated = 0, this.before = this.measured = performance.now();
    this.reach = 1.2;
    this.setSpeed();
    requestAnimationFrame(now => this.frame(now));
  }

  setSpeed() {
    const slower = 10 ** Number(at("slow").value);
    this.slower = Number(slower.toPrecision(2));
    const text = this.slower > 1 ? `${plain(this.slower)} times slower` : "real time";
    at("slow-shown").textContent = text, at("slow").setAttribute("aria-valuetext", text);
    this.busy = this.simulated = 0;
  }

  frame(now) {
    const scene = this.scene, spent = Math.min(Math.max(now - this.before, 0), 100);
    this.before = now;
    if (scene.running && !scene.broken && !this.held) this.compute(spent);
    if (now - this.measured > 700 && this.busy > 0) {
      // How much faster than the screen shows it the FMU runs, for both devices together.
      const factor = this.simulated / (this.busy / 1e3) * this.slower;
      at("factor").textContent = `${plain(Number(factor.toPrecision(2)))}×`, at("factor").dataset.value = factor;
      this.busy = this.simulated = 0, this.measured = now;
    }
    this.draw();
    if (this.frames++ % 6 === 0) this.drawPlots();
    document.documentElement.dataset.drawn = "yes";
    requestAnimationFrame(later => this.frame(later));
  }

  compute(spent) {
    const scene = this.scene, begin = performance.now();
    scene.owed += spent / 1e3 / this.slower / step;
    while (scene.owed >= 1) {
      const n = Math.min(Math.floor(scene.owed), 200);
      if (!scene.advance(n)) break;
      scene.owed -= n, this.simulated += n * step;
      if (performance.now() - begin > BUDGET) { scene.owed = Math.min(scene.owed, 1); break; }
    }
    this.busy += performance.now() - begin;
    const long = scene.swings.latest?.long;
    if (long) scene.first = Math.max(scene.first, long);
    if (long < STILL * scene.first && at("again").checked && !scene.numbers.get(data.references.u_x) && !scene.numbers.get(data.references.u_y)) scene.pluck();
  }

  draw() {
    const scene = this.scene, count = Math.min(Math.max(TRAIL_TIME / this.slower / step, 60), LENGTH);
    const wanted = 1.2 * Math.max(scene.swings.latest?.long ?? 0, scene.first, 1e-3);
    this.reach += 0.1 * (wanted - this.reach);
    this.map = drawOrbit(at("orbit"), scene.device.trail(count), at("ghost").checked && scene.ideal.trail(count), this.reach, this.held);
  }

  drawPlots() {
    const scene = this.scene, most = SHOWN_TO * data.frequency, glow = css("--glow"), second = css("--second"), ghost = css("--ghost");
    const found = spectra(...scene.device.ordered(), 1 / step, most), khz = found.f.map(f => f / 1e3);
    chart(at("spectrum"), {low: 0, high: most / 1e3, title: "f [kHz]"}, {low: -6, high: 1, log: true},
      [{x: khz, y: found.y, color: second}, {x: khz, y: found.x, color: glow}]);
    const s = scene.swings, i = scene.ideally, shown = at("ghost").checked;
    const end = ticks(0, Math.max(scene.time, 0.02) * 1.02, 1)[1] ?? scene.time * 1.02, time = {low: 0, high: Math.max(end, scene.time * 1.02), title: "t [s]"};
    const top = Math.ceil(Math.log10(scene.first + 1e-3) + 0.05);
    chart(at("ringdown"), time, {low: top - 3, high: top, log: true}, [
      ...(shown ? [{x: i.t, y: i.long, color: ghost, width: 3}] : []),
      {x: s.t, y: s.short, color: second}, {x: s.t, y: s.long, color: glow}]);
    const angles = [...s.angle, ...(shown ? i.angle : [])], low = Math.min(0, ...angles), high = Math.max(0, ...angles), room = 5 + 0.05 * (high - low);
    chart(at("angle"), time, {low: low - room, high: high + room}, [
      ...(shown ? [{x: i.t, y: i.angle, color: ghost, width: 3}] : []), {x: s.t, y: s.angle, color: glow}]);
    const latest = s.latest;
    at("long").textContent = latest ? `${latest.long.toPrecision(3)} V` : "–";
    at("turned").textContent = latest ? `${latest.angle.toFixed(1)}°` : "–";
    at("elapsed").textContent = `${plain(Number((1e3 * scene.time).toPrecision(3)))} ms`;
  }
}

function bindOrbit(player) {
  const canvas = at("orbit"), place = event => {
    const box = canvas.getBoundingClientRect();
    return [player.map.x(event.clientX - box.left), player.map.y(event.clientY - box.top)];
  };
  canvas.addEventListener("pointerdown", event => { player.held = place(event), canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointermove", event => { if (player.held) player.held = place(event); });
  canvas.addEventListener("pointercancel", () => { player.held = undefined; });
  canvas.addEventListener("pointerup", () => {
    if (!player.held) return;
    // Where the mass is let go, by the pickoff's gain.
    ["x_start", "y_start"].forEach((name, i) => at(`device-${name}`).dispatchEvent(new CustomEvent("put", {detail: player.held[i] / data.gains[i]})));
    player.held = undefined;
    player.scene.pluck();
  });
}

function bindSliders(scene) {
  const put = [];
  for (const place of document.querySelectorAll("[data-sliders]")) {
    for (const slider of data.sliders[place.dataset.sliders]) {
      const {row, bind} = controls.row(slider, "device");
      const set = value => bind(value, v => scene.set(slider, v));
      place.append(row), set(scene.numbers.get(slider.reference));
      row.querySelector("input").addEventListener("put", event => {
        const value = Math.min(Math.max(event.detail, slider.low), slider.high);
        scene.numbers.set(slider.reference, value), scene.idealNumbers.set(slider.reference, value), set(value);
      });
      put.push(() => { set(slider.start); scene.set(slider, slider.start); });
    }
  }
  at("reset").addEventListener("click", () => { put.forEach(back => back()), scene.pluck(); });
}

async function open() {
  const packed = Uint8Array.from(atob(at("module").textContent), c => c.charCodeAt(0));
  const module = await FmuModule.load(packed, data.token);
  const {hash, steps} = fingerprint(module, data.fingerprint);
  const same = hash === data.fingerprint.hash && steps === data.fingerprint.done;
  at("hash").textContent = hash, at("same").textContent = same ? "the same bits as the native FMU" : `not the bits of the native FMU, ${data.fingerprint.hash}`;
  document.documentElement.dataset.same = same ? "yes" : "no";
  scene = new Scene(module), player = new Player(scene);
  bindSliders(scene), bindOrbit(player);
  const pause = at("pause"), label = () => { pause.textContent = scene.running ? "Pause" : "Go on"; };
  label();
  pause.addEventListener("click", () => { scene.running = !scene.running, label(); });
  at("pluck").addEventListener("click", () => { scene.running = true, label(), scene.pluck(); });
  at("slow").addEventListener("input", () => player.setSpeed());
  at("tone").addEventListener("input", () => {
    scene.tone = Number(at("tone").value), at("tone-shown").textContent = `${Math.round(scene.tone)} Hz`;
  });
  if (data.hideable.length) {
    game = new Game(module, data, controls);
    const asked = Number(/^#case=(\d+)$/.exec(location.hash)?.[1]);
    game.open(asked || 1);
    addEventListener("resize", () => game.draw());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => game.draw());
  }
}

open().catch(error => { say(`The FMU does not run in this browser: ${error.message}`); throw error; });
