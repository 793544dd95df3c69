// Runs the FMU of a page in node, without the page: node play.mjs PAGE FIRST LAST prints the hash of the fixed run, and
// of each case from FIRST to LAST what it hides, its record's voltages and what a model leaves that says the same.

import fs from "node:fs";
import vm from "node:vm";

const html = fs.readFileSync(process.argv[2], "utf8");
const part = id => html.match(new RegExp(`<script[^>]* id="${id}">([^]*?)</script>`))[1];
const data = JSON.parse(part("data"));
const run = vm.runInThisContext(["fmu", "drawing", "hiding"].map(part).join("\n").replaceAll('"use strict";', "")
  + "\n({FmuModule, fingerprint, hiddenIn, commandsFor, Bench, rms, less})");
const module = await run.FmuModule.load(Buffer.from(part("module"), "base64"), data.token);
const bench = new run.Bench(module, data), known = new Map(data.experiment.known), device = new Map(data.experiment.device);
const cases = [];
for (let number = Number(process.argv[3]); number <= Number(process.argv[4]); number++) {
  const hidden = run.hiddenIn(number, data.hideable), size = [data.references[hidden.name], hidden.value];
  const record = bench.record(new Map([...device, size])), same = bench.record(new Map([...known, size]));
  const plain = bench.record(known), all = run.rms(record.x, record.y);
  const left = v => run.rms(run.less(record.x, v.x), run.less(record.y, v.y)) / all;
  cases.push({...hidden, number, v: [Array.from(same.x), Array.from(same.y)], unexplained: left(plain), right: left(same),
    commands: run.commandsFor(number, hidden, data.experiment, data.device)});
}
console.log(JSON.stringify({...run.fingerprint(module, data.fingerprint), cases}));
