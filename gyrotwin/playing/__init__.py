"""The gyroscope in a page: the FMU as a WebAssembly module, with what the page needs to know of it."""
