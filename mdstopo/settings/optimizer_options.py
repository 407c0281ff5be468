"""The optimiser's single settings: type, limits, default and words. Imports nothing heavy: the reader uses it
too."""

from typing import NamedTuple

Value = float | int | bool


class Option(NamedTuple):
    """One setting. `minimum` and `maximum` are inclusive, None where there is no limit (always for bool)."""

    type: type
    minimum: float | None
    maximum: float | None
    default: Value
    doc: str


OPTIONS: dict[str, Option] = {
    # The approximation.
    "power": Option(
        float,
        -5.0,
        1.0,
        0.9,
        "xi, the power of the approximation: 1 is linear, -1 reciprocal (0 stands for the logarithm)",
    ),
    "zero_shift": Option(
        bool,
        None,
        None,
        False,
        "keep the lower shifts at zero instead of moving them (CONLIN, OC); needs lower bounds >= 0",
    ),
    "sign_rule": Option(
        bool, None, None, False, "linear (xi = 1) in the variables in which a function rises (CONLIN, OC)"
    ),
    "shift_start": Option(
        float,
        1e-3,
        1e3,
        2.0,
        "first distance of the shifts from x, in ranges (upper - lower) of the variable",
    ),
    "shift_grow": Option(float, 1.0, 10.0, 1.2, "factor on that distance while a variable moves steadily"),
    "shift_shrink": Option(float, 0.01, 1.0, 0.7, "factor on that distance when a variable oscillates"),
    "shift_minimum": Option(float, 1e-6, 1e3, 0.01, "smallest distance of the shifts, in ranges"),
    "shift_maximum": Option(float, 1e-3, 1e6, 10.0, "largest distance of the shifts, in ranges"),
    "shift_margin": Option(
        float, 1e-6, 0.9, 0.1, "share of the distance to a shift that a step must leave (Svanberg's 0.1)"
    ),
    "convex_start": Option(
        float, 0.0, 1e6, 1e-3, "first weight of the quadratic term, relative to the largest gradient"
    ),
    "convex_grow": Option(float, 1.0, 100.0, 2.0, "factor on that weight when the model proves too low"),
    "convex_shrink": Option(float, 0.01, 1.0, 0.5, "factor on that weight when the model proves good"),
    "convex_drop": Option(
        float,
        0.0,
        1.0,
        0.1,
        "factor on that weight when it alone held a step back (decrease 1.5 times the predicted)",
    ),
    # The rows.
    "peaks": Option(int, 1, 6, 6, "how many competing peaks may become rows of the bound formulation"),
    "peak_window": Option(
        float,
        0.0,
        0.15,
        0.15,
        "how far below the highest a peak may lie to become a row, relative to the highest",
    ),
    "bundle": Option(
        bool,
        None,
        None,
        True,
        "use every row that trials have shown, and curvature, where rows compete (limits on responses, several peaks)",
    ),
    "elastic": Option(
        float,
        1.0,
        1e9,
        100.0,
        "penalty on violating a nonlinear constraint, relative to the objective's gradient",
    ),
    # The safeguards.
    "move_limit": Option(float, 1e-6, 1.0, 1.0, "largest change of a variable in one iteration, absolute"),
    "trust_region": Option(
        bool, None, None, True, "reject steps that do not decrease the objective and adapt a trust box"
    ),
    "trust_start": Option(float, 1e-6, 1.0, 0.2, "first half width of the trust box, in ranges of the variable"),
    "trust_grow": Option(float, 1.0, 10.0, 2.0, "factor on the trust box after a step that was predicted well"),
    "trust_shrink": Option(float, 0.01, 1.0, 0.5, "factor on the trust box after a step that was predicted badly"),
    "good_ratio": Option(float, 0.0, 1.0, 0.75, "actual / predicted decrease above which the trust box grows"),
    "poor_ratio": Option(float, 0.0, 1.0, 0.25, "actual / predicted decrease below which the trust box shrinks"),
    "accept_ratio": Option(float, 0.0, 1.0, 1e-3, "actual / predicted decrease below which a step is rejected"),
    # The stops.
    "decrease_tolerance": Option(
        float,
        0.0,
        1.0,
        1e-6,
        "stop when actual and predicted decrease are both below this share of the objective, twice running",
    ),
    "change_tolerance": Option(
        float, 0.0, 1.0, 1e-9, "stop when the largest change of a variable, in ranges, is below this"
    ),
    "failures": Option(int, 0, 1000, 8, "how many evaluations may fail in a row before the run is given up"),
}
