"""Which integrator a case gets, and why: the table of methods and the rule of `auto`."""

from types import ModuleType

import numpy as np

from mdstopo.case.model import SolverSettings
from mdstopo.integrators.driver import Method


def choose(solver: SolverSettings, beyond: str = "") -> tuple[str, str]:
    """Name of the integrator and the reason, as a sentence without a full stop.

    beyond: what in the case goes beyond springs between free bodies, in words.
    """
    if solver.integrator != "auto":
        return solver.integrator, "as the case says"
    if solver.sensitivity == "iterative":
        return "generalized_alpha", "the iterative sensitivity method is defined on its steps"
    if solver.spectral_radius is not None:
        return "generalized_alpha", "a spectral radius is given, which no other method has"
    if beyond:
        return "runge_kutta", f"explicit steps of high order that carry {beyond}"
    return "gauss", "adaptive collocation needs the fewest passes over the members on smooth motion"


def method_of(name: str, solver: SolverSettings) -> Method:
    """The method of that name with the case's settings."""
    return METHODS[name](solver)


def _gauss(solver: SolverSettings) -> Method:
    from mdstopo.integrators.gauss_tables import gauss_tables

    def load() -> ModuleType:
        from mdstopo.integrators import gauss_entry

        return gauss_entry

    return Method("gauss", load, gauss_tables(), steps=32, stages=256)


def _generalized_alpha(solver: SolverSettings) -> Method:
    def load() -> ModuleType:
        from mdstopo.integrators import generalized_alpha_entry

        return generalized_alpha_entry

    radius = 0.8 if solver.spectral_radius is None else solver.spectral_radius
    return Method("generalized_alpha", load, np.array([radius]), steps=1024, stages=1100)


def _runge_kutta(solver: SolverSettings) -> Method:
    from mdstopo.integrators.runge_kutta_tables import runge_kutta_tables

    def load() -> ModuleType:
        from mdstopo.integrators import runge_kutta_entry

        return runge_kutta_entry

    return Method("runge_kutta", load, runge_kutta_tables(), steps=64, stages=1200)


METHODS = {"gauss": _gauss, "generalized_alpha": _generalized_alpha, "runge_kutta": _runge_kutta}
