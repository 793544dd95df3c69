"""Measured data beside the simulation: data sets and what is wrong with them."""

MOST_EFFECTS = 6
"""Named unless the caller says otherwise; a search ends by significance long before in most data."""
