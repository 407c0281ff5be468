"""Pulses narrower than any step: Eq. 4 with sigma up to 1e12, whose impulse is f0 sqrt(pi/sigma)."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.stress.measuring import FULL, ball, differentiated, error, moved, spring, valued
from mdstopo.stress.scene import Scene

if TYPE_CHECKING:
    from mdstopo.case.model import Case

#: the impulse of every pulse, N s
IMPULSE = 0.4
WHEN = 0.3


def peak(rate: float) -> float:
    """The peak force f0 of a pulse with a given rate."""
    return float(IMPULSE * np.sqrt(rate / np.pi))


def pulled(rate: float, when: tuple[float, ...] = (WHEN,), **solver: Any) -> dict[str, Any]:
    """A body at rest, 3 m from ground, that members pull at once or one after another; the response is its speed."""
    law = {"type": "pulse", "peak": peak(rate), "rate": rate}
    return {
        "time": {"end": 1.0},
        "bodies": {"ball": ball(3.0)},
        "members": {f"pull{i}": spring([0.0, 0.0], "ball", [3.0, 0.0], **law, time=t) for i, t in enumerate(when)},
        "design": dict(FULL),
        "objectives": {"G": {"response": {"velocity": {"body": "ball"}}, "over_time": "final"}},
        "solver": solver,
    }


def _passed(rate: float, when: float, t: Any) -> Any:
    """Share of a pulse's impulse that has acted between 0 and t."""
    from scipy.special import erf

    root = np.sqrt(rate)
    return 0.5 * (erf(root * (t - when)) + erf(root * when))


def _speed(rate: float, when: tuple[float, ...], case: "Case") -> float:
    """Speed, place and gradient at the end."""
    shares = np.array([_passed(rate, t, 1.0) for t in when])
    found = valued(case)
    worst = max(
        error(found.objectives["G"], IMPULSE * float(shares.sum())), error(found.gradients["G"], IMPULSE * shares)
    )
    times = np.linspace(0.0, 1.0, 41)
    speed = -IMPULSE * sum(_passed(rate, t, times) for t in when)
    return max(worst, error(moved(case).at(times).v[:, 0], speed))


def struck(rate: float, **solver: Any) -> dict[str, Any]:
    """As `pulled`, with a spring of 400 N/m beside the pulse; the response is the largest acceleration."""
    scene = pulled(rate, **solver)
    scene["members"]["spring"] = spring([6.0, 0.0], "ball", [3.0, 0.0], stiffness=400.0)
    scene["objectives"] = {
        "A": {"response": {"acceleration": {"body": "ball"}}, "over_time": "max"},
        "E": {"response": "energy", "over_time": "max"},
    }
    scene["combine"] = {"weights": {"A": 1, "E": 1}}
    return scene


def _struck(rate: float, case: "Case") -> float:
    """A blow much shorter than a period: acceleration f0 / m in its midst, then a swing with its momentum.

    What the finite width of the pulse changes is of the order of omega^2 / sigma and left out.
    """
    found = valued(case)
    blow = peak(rate)

    def energy(alpha: Any) -> Any:
        return 0.5 * (alpha[0] * IMPULSE) ** 2

    value, gradient = differentiated(energy, np.ones(2))
    return max(
        error(found.objectives["A"], blow),
        error(found.gradients["A"][0], blow),
        error(found.objectives["E"], value),
        error(found.gradients["E"], gradient),
        error(found.peak_times["A"], WHEN),
    )


def scenes() -> list[Scene]:
    """Rates from a flat pulse to one of a microsecond, at any place of the time, alone and together."""
    found = []
    for exponent in (-12, 0, 4, 8, 12):
        rate = 10.0**exponent
        found.append(
            Scene(
                f"pulse-1e{exponent}",
                f"a pulse with sigma = 1e{exponent} 1/s2: speed over time and gradient, error functions",
                pulled(rate, integrator="runge_kutta", tolerance=1e-8),
                partial(_speed, rate, (WHEN,)),
                bound=1e-7,
            )
        )
    for name, words, when in (
        ("at-the-start", "at the start, half of which acts", (0.0,)),
        ("at-the-end", "at the end, half of which acts", (1.0,)),
        ("outside", "that is over before the start", (-1.0, 0.5)),
        ("together", "three of them, two at once", (0.2, 0.6, 0.6)),
        ("in-a-row", "five of them within ten microseconds", tuple(0.5 + 2e-6 * i for i in range(5))),
    ):
        found.append(
            Scene(
                f"pulse-{name}",
                f"pulses with sigma = 1e12, {words}: speed and gradient, error functions",
                pulled(1e12, when, integrator="runge_kutta", tolerance=1e-8),
                partial(_speed, 1e12, when),
                bound=1e-7,
            )
        )
    found.append(
        Scene(
            "pulse-blow",
            "a pulse with sigma = 1e12 on a spring: peaks of acceleration and energy, a blow in closed form",
            struck(1e12, tolerance=1e-8),
            partial(_struck, 1e12),
            bound=1e-7,
        )
    )
    for exponent, step in ((4, 1e-4), (12, 1e-3)):
        rate = 10.0**exponent
        found.append(
            Scene(
                f"pulse-1e{exponent}-generalized-alpha",
                f"a pulse with sigma = 1e{exponent} in fixed steps of {step:g} s: speed and gradient",
                pulled(rate, integrator="generalized_alpha", step=step),
                partial(_speed, rate, (WHEN,)),
                bound=1e-3,
            )
        )
    found.append(
        Scene(
            "pulse-1e12-generalized-alpha-chosen",
            "a pulse with sigma = 1e12 in the steps that a tolerance of 1e-4 chooses: speed and gradient",
            pulled(1e12, integrator="generalized_alpha", tolerance=1e-4),
            partial(_speed, 1e12, (WHEN,)),
            bound=1e-3,
        )
    )
    return found
