"""The WebAssembly component of an FMU, by the draft of FMI's layered standard fmi-ls-wasm."""
