"""Rules of integration with better ones that have their nodes."""

import numpy as np
import pytest
from numpy.polynomial import legendre

from mdstopo.general.over_time.nested_rules import DEGREE, GAUSS, nested_rules
from mdstopo.integrators.esdirk_tables import esdirk_tables
from mdstopo.integrators.gauss_tables import LEVELS
from mdstopo.integrators.runge_kutta_tables import GENERAL, NYSTROEM, VECTORS, B, C, runge_kutta_tables


def of_stages(vectors):
    """Nodes and weights of a Runge-Kutta method."""
    weighed = vectors[B] != 0.0
    return vectors[C][weighed], vectors[B][weighed]


def of_gauss(count):
    nodes, weights = legendre.leggauss(count)
    return (nodes + 1) / 2, weights / 2


#: each with the degree up to which the rule itself is exact
RULES = {
    "Dormand and Prince": (*of_stages(runge_kutta_tables()[GENERAL, VECTORS]), 7),
    "Nystroem": (*of_stages(runge_kutta_tables()[NYSTROEM, VECTORS]), 11),
    "ESDIRK": (*of_stages(esdirk_tables()[0, VECTORS]), 3),
    "trapezoids": (np.array([0.0, 1.0]), np.array([0.5, 0.5]), 1),
} | {f"Gauss {count}": (*of_gauss(count), 2 * count - 1) for count in LEVELS}


@pytest.mark.parametrize("name", RULES)
def test_the_better_rule_is_exact_further_and_the_rule_is_what_it_was(name):
    nodes, weights, exact = RULES[name]
    rules = nested_rules(tuple(nodes.tolist()), tuple(weights.tolist()))
    assert rules.places.min() >= 0.0
    assert rules.places.max() <= 1.0
    degree = max(DEGREE, exact + 4)
    # rules of high degree: monomials about the middle, whose integrals are known
    for power in range(degree + 1):
        values = (2.0 * rules.places - 1.0) ** power
        integral = (1.0 + (-1.0) ** power) / 2.0 / (power + 1)
        assert rules.better @ values == pytest.approx(integral, abs=1e-12)
        assert rules.own @ values == pytest.approx(weights @ (2.0 * nodes - 1.0) ** power, abs=1e-14)


def test_explicit_steps_take_eleven_samples_and_no_rule_more_than_gauss_would():
    sizes = {name: len(nested_rules(tuple(x.tolist()), tuple(w.tolist())).places) for name, (x, w, _) in RULES.items()}
    assert sizes["Dormand and Prince"] == 11
    for name, (nodes, *_) in RULES.items():
        if not name.startswith("Gauss"):
            assert sizes[name] <= len(set(nodes.tolist())) + GAUSS
