"""Which integrator a case gets, and why: the rule of `auto`, and the methods that the records name."""

from pkgutil import resolve_name

import numpy as np

from mdstopo.case.methods.integrators import ADAPTIVE, AUTO, FIXED, INTEGRATORS, SMOOTH, having
from mdstopo.case.methods.sensitivities import chosen
from mdstopo.case.model import SolverSettings
from mdstopo.integrators.scene_driver import Method


def choose(solver: SolverSettings, beyond: str = "", collocates: bool = False) -> tuple[str, str]:
    """Name of the integrator and the reason, as a sentence without a full stop.

    beyond: what in the case goes beyond springs between free bodies, in words. collocates: whether collocation carries
    it (`scene.family.collocates`).
    """
    if solver.integrator != AUTO:
        return solver.integrator, "as the case says"
    needed = chosen(solver.sensitivity).steps
    if needed:
        return having(needed)[0], f"the {solver.sensitivity} sensitivity method is defined on its steps"
    if solver.spectral_radius is not None:
        return FIXED, "a spectral radius is given, which no other method has"
    if beyond and not collocates:
        return ADAPTIVE, f"explicit steps of high order that carry {beyond}"
    return SMOOTH, "adaptive collocation needs the fewest passes over the members on smooth motion"


def method_of(name: str, solver: SolverSettings) -> Method:
    """The method of that name with the case's settings."""
    made: Method = resolve_name(INTEGRATORS[name].made_by)(solver)
    return made


def has_coarse_steps(solver: SolverSettings) -> bool:
    """Whether steps of a general scene are of low order and do not follow the tolerance."""
    return not INTEGRATORS[choose(solver, "laws")[0]].adaptive


def gauss(_: SolverSettings) -> Method:
    from mdstopo.integrators.gauss_tables import gauss_tables

    return Method(INTEGRATORS["gauss"], gauss_tables(), steps=32, stages=256, collocates=True)


def generalized_alpha(solver: SolverSettings) -> Method:
    radius = 0.8 if solver.spectral_radius is None else solver.spectral_radius
    return Method(INTEGRATORS["generalized_alpha"], np.array([radius]), steps=1024, stages=1100)


def runge_kutta(_: SolverSettings) -> Method:
    from mdstopo.integrators.runge_kutta_tables import runge_kutta_tables

    return Method(INTEGRATORS["runge_kutta"], runge_kutta_tables(), steps=64, stages=1200)


def esdirk(_: SolverSettings) -> Method:
    from mdstopo.integrators.esdirk_tables import STAGES, esdirk_tables

    return Method(INTEGRATORS["esdirk"], esdirk_tables(), steps=64, stages=64 * STAGES)
