"use strict";
// The FMU as a WebAssembly module: the functions of FMI 3.0 that it exports, called on arrays in its own memory.

const OK = 0;

class FmuModule {
  // The module's bytes are packed by gzip.
  static async load(packed, token) {
    const unpacked = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    const {instance} = await WebAssembly.instantiate(await new Response(unpacked).arrayBuffer(), {});
    instance.exports._initialize();
    return new FmuModule(instance.exports, token);
  }

  constructor(functions, token) {
    this.fmi = functions;
    this.token = this.text(token);
  }

  text(words) {
    const bytes = new TextEncoder().encode(words + "\0");
    const at = this.fmi.malloc(bytes.length);
    new Uint8Array(this.fmi.memory.buffer).set(bytes, at);
    return at;
  }
}

// Variables by value reference with a place for their numbers.
class Variables {
  constructor(module, references) {
    this.fmi = module.fmi;
    this.size = references.length;
    this.references = this.fmi.malloc(4 * this.size + 8);
    this.at = this.fmi.malloc(8 * this.size + 8);
    new Uint32Array(this.fmi.memory.buffer, this.references, this.size).set(references);
  }

  // The memory may have grown since, which leaves older views without a buffer.
  get values() {
    if (this.kept?.buffer !== this.fmi.memory.buffer) this.kept = new Float64Array(this.fmi.memory.buffer, this.at, this.size);
    return this.kept;
  }

  set(instance) {
    return this.fmi.fmi3SetFloat64(instance, this.references, this.size, this.at, this.size) === OK;
  }

  get(instance) {
    return this.fmi.fmi3GetFloat64(instance, this.references, this.size, this.at, this.size) === OK;
  }

  free() {
    this.fmi.free(this.references);
    this.fmi.free(this.at);
  }
}

class FmuInstance {
  constructor(module) {
    this.module = module;
    this.fmi = module.fmi;
    this.flags = this.fmi.malloc(16);
    const t = module.token;
    this.handle = this.fmi.fmi3InstantiateCoSimulation(t, t, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
    if (!this.handle) throw new Error("the FMU can't be instantiated");
  }

  set(reference, value) {
    const one = new Variables(this.module, [reference]);
    one.values[0] = value;
    const done = one.set(this.handle);
    one.free();
    return done;
  }

  setWhole(reference, value) {
    const one = new Variables(this.module, [reference]);
    new Int32Array(this.fmi.memory.buffer, one.at, 1)[0] = value;
    const done = this.fmi.fmi3SetInt32(this.handle, one.references, 1, one.at, 1) === OK;
    one.free();
    return done;
  }

  // Starts anew with `numbers` and `whole`, both by value reference, at time 0.
  start(numbers, whole) {
    const references = [...numbers.keys()];
    const all = new Variables(this.module, references);
    all.values.set(references.map(reference => numbers.get(reference)));
    let done = this.fmi.fmi3Reset(this.handle) === OK && all.set(this.handle);
    all.free();
    for (const [reference, value] of whole) done = done && this.setWhole(reference, value);
    return done && this.fmi.fmi3EnterInitializationMode(this.handle, 0, 0, 0, 0, 0) === OK
      && this.fmi.fmi3ExitInitializationMode(this.handle) === OK;
  }

  // False where the motion diverges.
  step(time, size) {
    const f = this.flags;
    return this.fmi.fmi3DoStep(this.handle, time, size, 1, f, f + 1, f + 2, f + 8) === OK;
  }

  free() {
    this.fmi.fmi3FreeInstance(this.handle);
    this.fmi.free(this.flags);
  }
}

// FNV-1a with 64 bits.
function hashOf(bytes, before = 0xcbf29ce484222325n) {
  let hash = before;
  for (const byte of bytes) hash = BigInt.asUintN(64, (hash ^ BigInt(byte)) * 0x100000001b3n);
  return hash;
}

// Plays the fixed run of `plan`; gives the hash of all outputs and the steps done.
function fingerprint(module, plan) {
  const fmu = new FmuInstance(module);
  const inputs = new Variables(module, plan.inputs), outputs = new Variables(module, plan.outputs);
  let hash, k = 0;
  if (fmu.start(new Map(plan.numbers), new Map(plan.whole))) {
    for (; k < plan.steps; k++) {
      plan.rest.forEach((rest, i) => { inputs.values[i] = rest + plan.sizes[i] * ((37 * k + 11 * i) % 17 - 8); });
      if (!(inputs.set(fmu.handle) && fmu.step(k * plan.step, plan.step) && outputs.get(fmu.handle))) break;
      hash = hashOf(new Uint8Array(outputs.values.buffer, outputs.at, 8 * outputs.size), hash);
    }
  }
  inputs.free(), outputs.free(), fmu.free();
  return {hash: (hash ?? 0n).toString(16).padStart(16, "0"), steps: k};
}
