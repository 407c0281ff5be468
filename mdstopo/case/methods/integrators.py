"""The integrators that a case file may name: what is declared of each, one record an integrator.

What a record names has the interface of `integrators.steps_interface` and `general.steps.method_interface`.
"""

from __future__ import annotations

from typing import NamedTuple


class IntegratorKind(NamedTuple):
    """What is declared of an integrator: its name, where its code is, and what it can do.

    name: as case files have it; doc: a sentence for the case reference. made_by: module:function, called with the
    solver's settings, which returns the `integrators.scene_driver.Method`.
    springs: the module with its entries for springs between free bodies (`integrators.steps_interface`); general: that
    for all other scenes (`general.steps.method_interface`). Empty where there are none.
    adaptive: whether it chooses steps by the tolerance where none is given. finds_step: whether it finds a fixed step
    by itself. order: of the error of fixed steps in their length.
    explicit: whether stages follow from those before them. has_radius: whether it takes a spectral radius; iterative:
    whether the iterative sensitivity method is defined on its steps. free_only: whether its steps carry free bodies and
    smooth forces alone (`scene.family.beyond_collocation`). planar: whether its steps carry bodies in a plane alone.
    """

    name: str
    doc: str
    made_by: str
    springs: str = ""
    general: str = ""
    adaptive: bool = False
    finds_step: bool = False
    order: int = 2
    explicit: bool = False
    has_radius: bool = False
    iterative: bool = False
    free_only: bool = False
    planar: bool = False


#: the integrators by their name
INTEGRATORS: dict[str, IntegratorKind] = {
    kind.name: kind
    for kind in (
        IntegratorKind(
            "gauss",
            "adaptive collocation at Gauss nodes; for free bodies between which forces are smooth",
            "mdstopo.integrators.integrator_choice:gauss",
            springs="mdstopo.integrators.springs_gauss_entry",
            general="mdstopo.general.integrators.gauss_entry",
            adaptive=True,
            free_only=True,
        ),
        IntegratorKind(
            "runge_kutta",
            "explicit and adaptive; for everything",
            "mdstopo.integrators.integrator_choice:runge_kutta",
            springs="mdstopo.integrators.springs_runge_kutta_entry",
            general="mdstopo.general.integrators.runge_kutta_entry",
            adaptive=True,
            explicit=True,
        ),
        IntegratorKind(
            "generalized_alpha",
            "implicit, fixed steps; for stiff scenes and the paper's figures",
            "mdstopo.integrators.integrator_choice:generalized_alpha",
            springs="mdstopo.integrators.springs_generalized_alpha_entry",
            general="mdstopo.general.integrators.generalized_alpha_entry",
            finds_step=True,
            has_radius=True,
            iterative=True,
        ),
        IntegratorKind(
            "esdirk",
            "implicit, adaptive and L-stable, of order 4; for stiff contacts and dampers in a plane",
            "mdstopo.integrators.integrator_choice:esdirk",
            general="mdstopo.general.integrators.esdirk",
            adaptive=True,
            order=4,
            planar=True,
        ),
    )
}
#: the word for the integrator that suits the case, and the ones that it is in the end
AUTO = "auto"
SMOOTH, ADAPTIVE, FIXED, STIFF = "gauss", "runge_kutta", "generalized_alpha", "esdirk"


def names(_: bool = False) -> dict[str, str]:
    """The words of `solver.integrator` with what they mean."""
    auto = (
        "gauss for free bodies between which forces are smooth; else, or where dampers hold its steps short, "
        "runge_kutta, or esdirk where stability holds most steps short; the reason is printed"
    )
    return {AUTO: auto, **{kind.name: kind.doc for kind in INTEGRATORS.values()}}


def having(capability: str) -> list[str]:
    """The names of the integrators that have a capability."""
    return [kind.name for kind in INTEGRATORS.values() if getattr(kind, capability)]
