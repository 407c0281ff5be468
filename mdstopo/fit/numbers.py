"""How the numbers that are fitted enter the scene, and so how predictions are differentiated by them.

A number that parameters of laws follow from is differentiated through these, exactly. So is one that masses, inertias,
loads, gravity or velocities at the start follow from. What moves geometry (places of joints and points, prescribed
motions, bushings) is differentiated by central differences of motions that are computed more accurately.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.design.design_variables import varying as may_vary
from mdstopo.case.design.named_variables import laws_that_follow
from mdstopo.case.model import Case
from mdstopo.case.objects.fitting import FitNumber
from mdstopo.case.reader import Document
from mdstopo.case.text.errors import CaseError
from mdstopo.case.text.words import inside
from mdstopo.engine import Evaluator
from mdstopo.fit.prepared import LawPlace, case_at, varying
from mdstopo.general.driver.observed import BALANCE

EXACT, DIFFERENCES = "exact", "differences"
#: what the keys of defined names begin with
DEFINED = "define."
#: by how much numbers are shifted, relative to their size: for formulas, and for motions
SHIFT, SHIFT_OF_MOTIONS = 1e-3, 1e-4
#: the size of a number is at least this share of the way between its bounds
LEAST_SIZE = 3e-3
#: by how much parameters of laws may deviate from a linear function of the numbers, relative
STRAIGHT = 1e-12


class Numbers:
    """The numbers of a case that are fitted."""

    def __init__(self, case: Case, numbers: Sequence[FitNumber]) -> None:
        self.case = case
        self.keys = tuple(each.key for each in numbers)
        self.lower = np.array([each.range.lower for each in numbers])
        self.upper = np.array([each.range.upper for each in numbers])
        self.initial = np.array([each.range.initial for each in numbers])
        self._check_bounds()
        self._base = case_at(case, self.keys, self.initial)
        found = [self._effect(i) for i in range(len(numbers))]
        #: parameters of laws that follow from the numbers
        self.places: tuple[LawPlace, ...] = tuple(sorted({place for places, _ in found for place in places}))
        self._places_of = tuple(places for places, _ in found)
        #: of each number what it changes beside: nothing, the balance, or anything
        self.effects = tuple(effect for _, effect in found)
        self._follow = _FollowingLaws(case, self.keys, self.places)
        #: how predictions are differentiated by each
        self.derivatives = tuple(DIFFERENCES if effect == "anything" else EXACT for effect in self.effects)
        #: whether the scene stays the same but for parameters of laws that are known without reading the case again
        self.laws_alone = not any(self.effects) and self.straight is not None

    def case_at(self, x: FloatArray) -> Case:
        """The case at x (n,), with the parameters of laws as variables."""
        return varying(case_at(self.case, self.keys, x), self.places)

    def size(self, i: int, x: FloatArray) -> float:
        """How large number i is, for shifting it."""
        return float(max(abs(x[i]), LEAST_SIZE * (self.upper[i] - self.lower[i])))

    def values_at(self, x: FloatArray) -> FloatArray:
        """(L,) the parameters of laws at x (n,)."""
        if self.straight is not None:
            constant, matrix = self.straight
            return constant + matrix @ x
        return self._read(x)

    def chain(self, x: FloatArray) -> FloatArray:
        """(L, n) the derivatives of laws' parameters by the numbers at x (n,)."""
        if self.straight is not None:
            return self.straight[1]
        columns = []
        for i, own in enumerate(self._places_of):
            column = self._follow.slopes(i, own, x) if own else np.zeros(len(self.places))
            columns.append(self.slope(i, x, self._read, SHIFT, sixth=True) if column is None else column)
        return np.stack(columns, axis=1)

    @cached_property
    def straight(self) -> tuple[FloatArray, FloatArray] | None:
        """Constant (L,) and matrix (L, n) where laws' parameters are linear functions of all numbers, else None.

        None, too, where a number is differentiated by differences and so may be anywhere in them.
        """
        if DIFFERENCES in self.derivatives:
            return None
        middle = 0.5 * (self.lower + self.upper)
        constant = self._read(middle)
        columns = []
        for i, own in enumerate(self._places_of):
            if not own:
                columns.append(np.zeros(len(self.places)))
                continue
            one, other = middle.copy(), middle.copy()
            one[i], other[i] = self.upper[i], self.lower[i]
            columns.append((self._read(one) - self._read(other)) / (self.upper[i] - self.lower[i]))
        matrix = np.stack(columns, axis=1)
        constant = constant - matrix @ middle
        random = np.random.default_rng(0)
        for _ in range(3):
            x = random.uniform(self.lower, self.upper)
            try:
                found = self._read(x)
            except CaseError:  # not all that is between the bounds goes together
                return None
            size = np.abs(constant) + np.abs(matrix) @ np.abs(x)
            if np.any(np.abs(constant + matrix @ x - found) > STRAIGHT * size):
                return None
        return constant, matrix

    def slope(
        self, i: int, x: FloatArray, value: Callable[[FloatArray], FloatArray], shift: float, sixth: bool = False
    ) -> FloatArray:
        """The derivative of value(x) by number i within its bounds, by differences.

        i, x (n,): the number, and where.
        value: what is differentiated.
        shift: relative to the number's size.
        sixth: of sixth order, not of second, away from the bounds.
        """
        h = shift * self.size(i, x)

        def at(factor: float) -> FloatArray:
            moved = x.copy()
            moved[i] += factor * h
            return value(moved)

        reach = 3.0 if sixth else 1.0
        below, above = (x[i] - self.lower[i]) / h, (self.upper[i] - x[i]) / h
        if below >= reach and above >= reach:
            if not sixth:
                return (at(1.0) - at(-1.0)) / (2.0 * h)
            weights = ((1.0, 0.75), (2.0, -0.15), (3.0, 1.0 / 60.0))
            return sum(w * (at(k) - at(-k)) for k, w in weights) / h  # type: ignore[return-value]
        way = 1.0 if above >= below else -1.0
        return way * (-1.5 * at(0.0) + 2.0 * at(way) - 0.5 * at(2.0 * way)) / h

    def shifted(self, i: int, x: FloatArray) -> tuple[Case, Case, float]:
        """The cases with number i larger and smaller than at x (n,) within its bounds, and by how much they differ."""
        h = SHIFT * self.size(i, x)
        one, other = x.copy(), x.copy()
        one[i], other[i] = min(x[i] + h, self.upper[i]), max(x[i] - h, self.lower[i])
        return self.case_at(one), self.case_at(other), float(one[i] - other[i])

    # -- how

    def _read(self, x: FloatArray) -> FloatArray:
        return np.array([each.initial for each in self.case_at(x).variables])

    def _check_bounds(self) -> None:
        """Refuse bounds that the case does not allow. Raises CaseError."""
        mistakes = []
        for i, key in enumerate(self.keys):
            for bounds in (self.lower, self.upper):
                x = self.initial.copy()
                x[i] = bounds[i]
                try:
                    case_at(self.case, self.keys, x)
                except CaseError as error:
                    mistakes += [m for m in error.mistakes if m.path_key == inside("fit.estimate", key)] or list(
                        error.mistakes
                    )
        if mistakes:
            raise CaseError(mistakes, str(self.case.path or self.case.name))

    def _effect(self, i: int) -> tuple[set[LawPlace], str]:
        """What changes with number i: parameters of laws, and beside them nothing, the balance, or anything."""
        places: set[LawPlace] = set()
        beside: set[str] = set()
        h = SHIFT * self.size(i, self.initial)
        for bound in (min(self.initial[i] + h, self.upper[i]), max(self.initial[i] - h, self.lower[i])):
            x = self.initial.copy()
            x[i] = bound
            changed = case_at(self.case, self.keys, x)
            own, held = _laws_apart(self._base, changed)
            if held is None:
                return set(), "anything"
            places |= own
            beside |= self._changed_arrays(held)
        if not beside:
            return places, ""
        solver = self.case.solver
        if beside <= BALANCE and not solver.settle and not solver.assemble:
            return places, "balance"
        return set(), "anything"

    @cached_property
    def _arrays(self) -> Mapping[str, Any]:
        """The arrays of each load case at the start."""
        return {name: scene.model for name, scene in Evaluator(self._base, in_background=False).scenes.items()}

    def _changed_arrays(self, held: Case) -> set[str]:
        """Names of arrays in which a case's scenes differ from those at the start."""
        found: set[str] = set()
        for name, scene in Evaluator(held, in_background=False).scenes.items():
            before, now = self._arrays[name]._asdict(), scene.model._asdict()
            found |= {key for key, array in now.items() if not np.array_equal(array, before[key])}
        return found


class _FollowingLaws:
    """Parameters of laws that are expressions of defined names which are fitted: their exact derivatives.

    case: the case. keys: of all numbers that are fitted. places: parameters of laws that follow from any of them.
    """

    def __init__(self, case: Case, keys: Sequence[str], places: Sequence[LawPlace]) -> None:
        self._named = [i for i, key in enumerate(keys) if key.startswith(DEFINED)]
        self._places = places
        self._rows: dict[LawPlace, int] = {}
        if not self._named:
            return
        written = Document(case.text, path=case.path, overrides=case.overrides).written
        words = [keys[i].removeprefix(DEFINED) for i in self._named]
        self._expressions, found, paths = laws_that_follow(written, words)
        # what is fitted itself does not follow any more
        self._rows = {place: k for k, (place, path) in enumerate(zip(found, paths, strict=True)) if path not in keys}

    def slopes(self, i: int, own: Collection[LawPlace], x: FloatArray) -> FloatArray | None:
        """(L,) of all places by number i at x (n,), of which own follow; None where that is not known exactly."""
        if i not in self._named or any(place not in self._rows for place in own):
            return None
        slopes = self._expressions.slopes(x[self._named])[:, self._named.index(i)]
        return np.array([slopes[self._rows[place]] if place in own else 0.0 for place in self._places])


def _laws_apart(base: Case, changed: Case) -> tuple[set[LawPlace], Case | None]:
    """Parameters of laws in which a case differs, and the case without these differences; None where laws differ in
    what cannot be varied, or groups do."""
    if [group.name for group in base.members] != [group.name for group in changed.members]:
        return set(), None
    places: set[LawPlace] = set()
    for group, other in zip(base.members, changed.members, strict=True):
        for place, (law, now) in enumerate(zip(group.laws, other.laws, strict=True)):
            can = may_vary(law)
            for field in fields(law):
                before, after = getattr(law, field.name), getattr(now, field.name)
                if np.array_equal(before, after):
                    continue
                if field.name not in can:
                    return set(), None
                places.add((group.name, place, field.name))
    laws = {group.name: group.laws for group in base.members}
    return places, replace(changed, members=tuple(replace(group, laws=laws[group.name]) for group in changed.members))
