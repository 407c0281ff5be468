"""Codes of the reductions over time in the kernels of springs between free bodies (`case.methods.over_time` names them)."""

MAX, MIN, MEAN, INTEGRAL, FINAL = range(5)
