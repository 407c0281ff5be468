"""Codes of the reductions over time in the kernels of springs between free bodies (names: `case.methods.over_time`)."""

MAX, MIN, MEAN, INTEGRAL, FINAL = range(5)
