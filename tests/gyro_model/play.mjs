// What play.c does, on the wasm32 module of an FMU: node play.mjs MODULE < SCENARIOS

import fs from "node:fs";

const module = await WebAssembly.instantiate(fs.readFileSync(process.argv[2]), {});
const f = module.instance.exports;
f._initialize();
const words = fs.readFileSync(0, "utf8").split(/\s+/);
let at = 0;
const count = () => Number(words[at++]);
const bits = new DataView(new ArrayBuffer(8));
const double = () => (bits.setBigUint64(0, BigInt("0x" + words[at++])), bits.getFloat64(0));
const list = (withValues) =>
  Array.from({ length: count() }, () => ({ reference: count(), value: withValues ? double() : 0 }));

const memory = () => new DataView(f.memory.buffer);
const text = (s) => {
  const p = f.malloc(s.length + 1);
  [...s, "\0"].forEach((c, i) => memory().setUint8(p + i, c.charCodeAt(0)));
  return p;
};
const references = (l) => {
  const p = f.malloc(4 * l.length + 4);
  l.forEach((v, i) => memory().setUint32(p + 4 * i, v.reference, true));
  return p;
};
const put = (p, values) => values.forEach((v, i) => memory().setFloat64(p + 8 * i, v, true));
const check = (status, what) => {
  if (status !== 0) throw new Error(what);
};
const hash = (h, p, size) => {
  const bytes = new Uint8Array(f.memory.buffer, p, size);
  for (const b of bytes) h = BigInt.asUintN(64, (h ^ BigInt(b)) * 0x100000001b3n);
  return h;
};
const FIRST = 0xcbf29ce484222325n;
const results = f.malloc(64);

const hashOfState = (c) => {
  memory().setUint32(results, 0, true);
  check(f.fmi3GetFMUState(c, results), "state");
  const state = memory().getUint32(results, true);
  check(f.fmi3SerializedFMUStateSize(c, state, results + 8), "size");
  const size = memory().getUint32(results + 8, true);
  const bytes = f.malloc(size);
  check(f.fmi3SerializeFMUState(c, state, bytes, size), "bytes");
  const h = hash(FIRST, bytes, size);
  f.free(bytes);
  check(f.fmi3FreeFMUState(c, results), "free");
  return h;
};

const token = text(words[at++]);
const outputs = list(false);
const out = f.malloc(8 * outputs.length), outReferences = references(outputs);
while (words[at]) {
  const name = words[at++];
  const inputs = list(true), offsets = list(true), parameters = list(true);
  const seed = { reference: count(), value: count() };
  const steps = count(), step = double();
  const c = f.fmi3InstantiateCoSimulation(token, token, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
  const values = f.malloc(8 * parameters.length + 8);
  put(values, parameters.map((v) => v.value));
  check(f.fmi3SetFloat64(c, references(parameters), parameters.length, values, parameters.length), name);
  memory().setInt32(values, seed.value, true);
  check(f.fmi3SetInt32(c, references([seed]), 1, values, 1), name);
  check(f.fmi3EnterInitializationMode(c, 0, 0, 0, 0, 0) || f.fmi3ExitInitializationMode(c), name);
  const inReferences = references(inputs), set = f.malloc(8 * inputs.length + 8);
  let h = FIRST;
  let k = 0;
  for (let ok = true; k < steps && ok; k += ok ? 1 : 0) {
    put(set, inputs.map((v, i) => offsets[i].value + v.value * (((37 * k + 11 * i) % 17) - 8)));
    check(f.fmi3SetFloat64(c, inReferences, inputs.length, set, inputs.length), name);
    ok = f.fmi3DoStep(c, k * step, step, 1, results, results + 1, results + 2, results + 8) === 0;
    check(f.fmi3GetFloat64(c, outReferences, outputs.length, out, outputs.length), name);
    if (ok) h = hash(h, out, 8 * outputs.length);
  }
  const hex = (x) => x.toString(16).padStart(16, "0");
  console.log(name, k, hex(h), hex(k === steps ? hashOfState(c) : 0n));
  f.fmi3FreeInstance(c);
}
