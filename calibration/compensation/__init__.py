"""Temperature compensation of a rate-mode record: sources 003 (piecewise lines) and 002 (a small network), and splines.

Every method gives a scale factor S(X) and a bias B(X) from what a gyroscope knows of its own temperature; the
compensated rate is

    rate / S(X) - B(X)

scale factor first, as source 003 has it: dividing changes the bias, subtracting does not change the scale factor.
"""
