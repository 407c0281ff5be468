"""Whether explicit steps are held short by stability: what a motion in them tells, from which `auto` chooses.

A damper or a contact with friction that acts much faster than anything moves lets explicit steps be only so long,
however little accuracy asks for; the method measures that (`integrators.steps.decay_rate`). Where it holds for most
steps and for many, implicit ones are fewer by more than each costs.
"""

from typing import TYPE_CHECKING

from mdstopo.integrators.driver import MAX_STEPS
from mdstopo.integrators.steps import ACCEPTED, HELD_SHORT, STEP_LIMIT
from mdstopo.scene.model import FloatArray

if TYPE_CHECKING:
    from mdstopo.general.general_driver import GeneralDriver

#: steps of a motion that have to be held short, and their share, before implicit ones pay; steps that tell enough
MANY, MOST, ENOUGH = 4000, 0.5, 8000


def held_short(driver: "GeneralDriver", alpha: FloatArray) -> str:
    """In words that explicit steps of a design alpha (N,) are held short by stability; or nothing."""
    driver.allow(ENOUGH)
    try:
        code, _, _ = driver.run(alpha, False)
    finally:
        driver.allow(MAX_STEPS)
    held, steps = int(driver.work[HELD_SHORT]), int(driver.work[ACCEPTED])
    hopeless = code == STEP_LIMIT and steps < ENOUGH  # held so short that the motion was given up before (`braking`)
    if held < MOST * steps or not (hopeless or held >= MANY):
        return ""
    return f"stability holds {held} of {steps} explicit steps short, not accuracy"
