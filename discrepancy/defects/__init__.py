"""Defects of a record, one file each: see ``discrepancy/defect.py``."""
