"""Sweeps: one task at many points, on the cores of this machine or of a cluster."""
