"""What the device is: quantities, effects, and everything made from them (C, XML, reference simulation,
documentation)."""

VERSION = "0.1.0"
RELEASED = "2026-11-22T00:00:00Z"
"""Date of that version, which its FMUs bear; the environment's SOURCE_DATE_EPOCH is put in its place."""
