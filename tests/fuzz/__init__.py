"""Fuzzers of the C: `python -m tests.fuzz` compiles and runs them."""
