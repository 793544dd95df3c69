"""A datasheet: the tests of IEEE Std 1431 and the Allan analysis of IEEE Std 952 on a simulated gyroscope."""
