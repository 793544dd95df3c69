"""Defects of a record, one file each: see ``discrepancy/fit/defect.py``."""
