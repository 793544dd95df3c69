"""The one reader of measured tables: a file becomes checked columns in SI."""

from gyro_model.tables.plausible import Doubt, misread
from gyro_model.tables.reader import SUFFIXES, read_table
from gyro_model.tables.table import Table, stated_unit

__all__ = ["SUFFIXES", "Doubt", "Table", "misread", "read_table", "stated_unit"]
