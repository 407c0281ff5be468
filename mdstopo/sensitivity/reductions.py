"""Reductions of a response over time: the words of the case file and the codes of the kernels."""

MAX, MIN, MEAN, INTEGRAL, FINAL, MAX_ABS, RMS = range(7)

REDUCTIONS = {
    "max": MAX,
    "min": MIN,
    "mean": MEAN,
    "integral": INTEGRAL,
    "final": FINAL,
    "max_abs": MAX_ABS,
    "rms": RMS,
}

#: those that are integrals over time
INTEGRALS = ("mean", "integral", "rms")
