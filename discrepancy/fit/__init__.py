"""The model on the records: simulated, refitted, and what it leaves as noise and as no noise."""
