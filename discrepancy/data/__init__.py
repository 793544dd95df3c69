"""What was measured: records, their data set, tables of a laboratory, and what they show without a model."""
