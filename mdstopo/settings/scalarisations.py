"""How several objectives become one: what is declared of each way, one record a way.

What a record names is in `optimizer.scalarisation`. Imports nothing heavy: the reader uses it too.
"""

from typing import NamedTuple


class ScalarisationKind(NamedTuple):
    """What is declared of a way to combine several objectives to one number U.

    name: as case files and `--method` have it; doc: a formula or a sentence for the case reference. made_by:
    module:class, derived from `optimizer.scalarisation.Formula`. in_cases: whether a case may name it; else it is for
    fronts alone, whose points it spreads evenly between the ends. takes_exponent: whether `exponent` is part of it.
    scaled: whether it is of the objectives scaled by Eq. 24; else of raw values.
    """

    name: str
    doc: str
    made_by: str
    in_cases: bool = True
    takes_exponent: bool = False
    scaled: bool = True


_HERE = "mdstopo.optimizer.scalarisation"

#: the ways by their name
SCALARISATIONS: dict[str, ScalarisationKind] = {
    kind.name: kind
    for kind in (
        ScalarisationKind(
            "weighted_exponential",
            "U = sum w g^p (Eq. 23), continued oddly below zero",
            f"{_HERE}:SumOfPowers",
            takes_exponent=True,
        ),
        ScalarisationKind("weighted_sum", "U = sum w g", f"{_HERE}:Sum"),
        ScalarisationKind("weighted_min_max", "U = max w g", f"{_HERE}:Largest"),
        ScalarisationKind(
            "weighted_product",
            "U = prod G^w of raw values, which must be positive",
            f"{_HERE}:Product",
            scaled=False,
        ),
        ScalarisationKind("nbi", "normal boundary intersection", f"{_HERE}:BoundaryIntersection", in_cases=False),
        ScalarisationKind("nc", "the normal constraint", f"{_HERE}:NormalConstraint", in_cases=False),
    )
}
#: the way of cases that name none, and that of one objective alone
DEFAULT_SCALARISATION, SUM = "weighted_exponential", "weighted_sum"


def names() -> dict[str, str]:
    """The ways that a case may name, with what they are."""
    return {kind.name: kind.doc for kind in SCALARISATIONS.values() if kind.in_cases}


def taking_exponent() -> list[str]:
    """The names of the ways to which an exponent belongs."""
    return [kind.name for kind in SCALARISATIONS.values() if kind.takes_exponent]
