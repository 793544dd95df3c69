"""The tests of a datasheet, one a file with ``PROCEDURE``."""
