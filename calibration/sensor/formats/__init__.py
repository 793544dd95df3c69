"""Formats of other programs, one a file with ``FORMAT``, found by a scan."""
