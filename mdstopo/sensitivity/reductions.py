"""Reductions of a response over time: the words of the case file and the codes of the springs' kernels."""

MAX, MIN, MEAN, INTEGRAL, FINAL = range(5)

#: those of stored energy between free bodies
REDUCTIONS = {"max": MAX, "min": MIN, "mean": MEAN, "integral": INTEGRAL, "final": FINAL}

#: those that are integrals over time: of g (1), of its square (2)
INTEGRALS = {"mean": 1, "integral": 1, "rms": 2}
