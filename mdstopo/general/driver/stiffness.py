"""Whether dampers hold steps short, and not accuracy: what a motion in them tells, from which `auto` chooses.

A damper or a contact with friction that acts much faster than anything moves lets explicit steps be only so long,
however little accuracy asks for; the method measures that (`integrators.steps.decay_rate`). Where it holds for most
steps and for many, implicit ones are fewer by more than each costs. Windows of collocation are held as short, because
the iterations that solve their equations do not contract, and each costs more than an explicit step.
"""

from typing import TYPE_CHECKING

from mdstopo.integrators.driver import MAX_STEPS
from mdstopo.integrators.steps import ACCEPTED, HELD_SHORT, STEP_LIMIT
from mdstopo.scene.springs_model import FloatArray

if TYPE_CHECKING:
    from mdstopo.general.driver.general_driver import GeneralDriver

#: steps of a motion that have to be held short, and their share, before implicit ones pay; steps that tell enough
MANY_STEPS, STIFF_SHARE, ENOUGH_STEPS = 4000, 0.5, 8000
#: windows of collocation that have to be held short before explicit steps pay; windows that tell enough
MANY_WINDOWS, ENOUGH_WINDOWS = 50, 500


def windows_held_short(driver: "GeneralDriver", alpha: FloatArray) -> str:
    """Why windows of collocation are short with the design alpha (N,), in words; empty where they are not."""
    driver.allow(ENOUGH_WINDOWS)
    try:
        driver.run(alpha, False)
    finally:
        driver.allow(MAX_STEPS)
    held, windows = int(driver.work[HELD_SHORT]), int(driver.work[ACCEPTED])
    if held < max(STIFF_SHARE * windows, MANY_WINDOWS):
        return ""
    return f"dampers hold {held} of {windows} windows of collocation short"


def held_short(driver: "GeneralDriver", alpha: FloatArray) -> str:
    """That stability limits explicit steps with the design alpha (N,), in words; empty where it does not."""
    driver.allow(ENOUGH_STEPS)
    try:
        code, _, _ = driver.run(alpha, False)
    finally:
        driver.allow(MAX_STEPS)
    held, steps = int(driver.work[HELD_SHORT]), int(driver.work[ACCEPTED])
    # held so short that the motion was given up before (`braking`)
    hopeless = code == STEP_LIMIT and steps < ENOUGH_STEPS
    if held < STIFF_SHARE * steps or not (hopeless or held >= MANY_STEPS):
        return ""
    return f"stability holds {held} of {steps} explicit steps short, not accuracy"
