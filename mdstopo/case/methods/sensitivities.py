"""The methods of differentiation that a case may name: what is declared of each, one record a method.

What a record names differentiates what a driver of a general scene has found, and stands in `general.driver.methods`.
"""

from __future__ import annotations

from typing import NamedTuple


class SensitivityKind(NamedTuple):
    """What is declared of a method of differentiation: its name, where its code is, and what it can do.

    name: as case files have it; doc: a sentence for the case reference. made_by: module:function, called as
    `general.driver.methods.by_direct` is; empty of a method whose gradients come with the values, from a sweep
    backwards: the only one that springs between free bodies have in kernels of their own. by_parameters: whether it
    differentiates by more than alpha: parameters of laws, points, defined names. of_candidates: whether prices of
    candidates follow from it. of_histories: whether derivatives at every time do. is_exact: whether its gradients are
    those of the computed values, to rounding. tells_norms: whether it tells how the direction of a norm's vector
    changes (`evaluation.Peak.across`). steps: the capability that an integrator needs for it
    (`case.integrators.IntegratorKind`), empty where all will do.
    """

    name: str
    doc: str
    made_by: str = ""
    by_parameters: bool = False
    of_candidates: bool = False
    of_histories: bool = False
    is_exact: bool = True
    tells_norms: bool = True
    steps: str = ""

    @property
    def comes_with_values(self) -> bool:
        """Whether gradients are computed together with the values."""
        return not self.made_by


_HERE = "mdstopo.general.driver.methods"

#: the methods by their name; the first is that of cases that name none
SENSITIVITIES: dict[str, SensitivityKind] = {
    kind.name: kind
    for kind in (
        SensitivityKind(
            "adjoint",
            "the exact gradient by a reverse sweep; its cost does not grow with the number of members",
            by_parameters=True,
            of_candidates=True,
        ),
        SensitivityKind(
            "direct",
            "the same, carried forward; its cost grows with the number of members",
            f"{_HERE}:by_direct",
            by_parameters=True,
            of_histories=True,
        ),
        SensitivityKind(
            "iterative",
            "the same on the steps of generalized_alpha, by fixed-point iterations",
            f"{_HERE}:by_iterative",
            steps="iterative",
        ),
        SensitivityKind(
            "constant_load",
            "inertia and loads frozen at the peak: an approximation",
            f"{_HERE}:by_constant_load",
            is_exact=False,
            tells_norms=False,
        ),
    )
}
#: the word for the method of cases that name none, and that method
AUTO_SENSITIVITY, DEFAULT_SENSITIVITY = "auto", next(iter(SENSITIVITIES))


def names() -> dict[str, str]:
    """The words of `solver.sensitivity` with what they mean."""
    return {AUTO_SENSITIVITY: DEFAULT_SENSITIVITY, **{kind.name: kind.doc for kind in SENSITIVITIES.values()}}


def chosen(word: str) -> SensitivityKind:
    """The method that a word of `solver.sensitivity` stands for."""
    return SENSITIVITIES[DEFAULT_SENSITIVITY if word == AUTO_SENSITIVITY else word]


def having(capability: str) -> list[str]:
    """The names of the methods that have a capability."""
    return [kind.name for kind in SENSITIVITIES.values() if getattr(kind, capability)]
