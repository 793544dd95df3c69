"""What a run in a scenario shows of the gyroscope: pure functions of its record."""
