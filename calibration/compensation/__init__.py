"""Temperature compensation of a rate-mode record: piecewise lines (Liu et al. 2014), a small network
(CN 105222765) and splines.

Every method gives a scale factor S(X) and a bias B(X) from what a gyroscope knows of its own temperature; the
compensated rate is

    rate / S(X) - B(X)

scale factor first, as Liu et al. have it: dividing changes the bias, subtracting does not change the scale factor
(docs/theory/compensation.md).
"""
