"""The commands: each a thin skin over a function of the package."""
