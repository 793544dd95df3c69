"""Measured data beside the simulation: data sets and what is wrong with them."""
