"""Rate mode: a drive loop holds frequency and amplitude, a sense loop gives the rate (docs/theory/rate.md)."""
