"""Kinds of runs, a file each with ``KIND``."""
