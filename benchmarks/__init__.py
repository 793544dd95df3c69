"""Benchmarks: what is promised, measured. ``python -m benchmarks`` runs them and writes benchmarks/results/."""
