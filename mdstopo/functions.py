"""A case as functions of a vector, for optimisers and frameworks that are not ours.

    responses = mdstopo.functions.Responses(case)
    found = scipy.optimize.minimize(**responses.for_scipy())

The vector is alpha (N,) with the values of the case's variables (P,) behind it, in the parameters' own units.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mdstopo.api import as_real, evaluate
from mdstopo.case.model import Case, FloatArray
from mdstopo.evaluation import Evaluation

_SIGNS = {"limit": -1.0, "at_least": 1.0, "equals": 1.0}


class NoValueError(ArithmeticError):
    """A design that cannot be computed; the sentence says why."""


@contextmanager
def extra(name: str, package: str) -> Iterator[None]:
    """Around the import of a package that an extra of mdstopo installs. Raises ModuleNotFoundError, which tells how to
    install it."""
    try:
        yield
    except ModuleNotFoundError as error:
        why = f"mdstopo.{name} needs {package} ({error}): pip install 'mdstopo[{name}]'"
        raise ModuleNotFoundError(why, name=error.name) from error


class Responses:
    """Objectives, then excesses of constraints over their bounds, of the designs of a case; each is evaluated once.

    names: of all of them. x0, lower, upper (n,): the initial design, and bounds. Raises NoValueError where a design
    cannot be computed. Where a member or a contact only just touches, derivatives are those of one side, and optimisers
    go on with them, as that of `run` does.
    """

    def __init__(self, case: Case, method: str = "auto") -> None:
        self.case, self._method = case, method
        self.objectives = tuple(objective.name for objective in case.objectives)
        self.names = (*self.objectives, *(f"constraints[{i}]" for i in range(len(case.constraints))))
        own = [np.full((2, each.count), [[each.lower], [each.upper]]) for each in case.variables]
        self.x0 = np.array(case.start)
        self.lower, self.upper = np.concatenate([np.array([case.lower, case.upper]), *own], axis=1)
        self._last: tuple[FloatArray, FloatArray, FloatArray] | None = None

    def __repr__(self) -> str:
        of, names = self.case.title or self.case.name, ", ".join(self.names)
        return f"<Responses of {of!r}: {names} by {len(self.x0):,} numbers>"

    def at(self, x: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """The values (m,) of objectives and constraints and their derivatives (m, n), at x (n,)."""
        asked = np.array(as_real(x, "x"))  # its own: it is compared with the next one
        if self._last is None or not np.array_equal(self._last[0], asked):
            alpha, values = asked[: self.case.n_design], self.case.space.named(asked)
            found = evaluate(self.case, alpha, variables=values, method=self._method)
            if not found.status.usable:
                raise NoValueError(f"{found.status.value}: {found.message}")
            self._last = asked, *self._rows(found)
        return self._last[1].copy(), self._last[2].copy()

    def _rows(self, found: Evaluation) -> tuple[FloatArray, FloatArray]:
        names, gradients, by_name = self.objectives, found.gradients, found.variable_gradients
        values = np.concatenate([[found.objectives[name] for name in names], found.constraints])
        rows = [np.concatenate([gradients[name], *by_name.get(name, {}).values()]) for name in names]
        own = list(found.constraint_variable_gradients.values())
        limits = np.concatenate([found.constraint_gradients, *own], axis=1)
        return values, np.concatenate([np.reshape(rows, (len(rows), limits.shape[1])), limits])

    def for_scipy(self, objective: str | None = None) -> dict[str, Any]:
        """Arguments of `scipy.optimize.minimize`: fun, jac, x0, bounds and constraints, as for SLSQP.

        objective: which of several; what is to be as large as possible has its sign turned.
        """
        name = self.objectives[0] if objective is None else objective
        if name not in self.objectives:
            raise ValueError(f"no objective {name!r}; there are {', '.join(self.objectives)}")
        place = self.objectives.index(name)
        sign = -1.0 if self.case.objectives[place].sense == "maximize" else 1.0
        rows = [
            {
                "type": "eq" if row.sense == "equals" else "ineq",
                "fun": self._value(len(self.objectives) + i, _SIGNS[row.sense]),
                "jac": self._slope(len(self.objectives) + i, _SIGNS[row.sense]),
            }
            for i, row in enumerate(self.case.constraints)
        ]
        bounds = list(zip(self.lower.tolist(), self.upper.tolist(), strict=True))
        both = {"fun": self._value(place, sign), "jac": self._slope(place, sign)}
        return {**both, "x0": self.x0.copy(), "bounds": bounds, "constraints": rows}

    def _value(self, row: int, sign: float) -> Callable[[ArrayLike], float]:
        return lambda x: sign * float(self.at(x)[0][row])

    def _slope(self, row: int, sign: float) -> Callable[[ArrayLike], FloatArray]:
        return lambda x: sign * self.at(x)[1][row]
