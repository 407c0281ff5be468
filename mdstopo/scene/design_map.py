"""From designs with defined names to designs of the numbers that scenes know, and back for derivatives.

Scenes vary parameters of laws and coordinates of points, each by itself, and numbers that masses, loads and velocities
at the start follow from. A case whose variables are defined names is computed as one in which what follows from them
varies: with values x of the names and numbers y(x),

    dG/dx = (dy/dx)^T dG/dy,

so a derivative is the sum over every place where an expression of the name stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.design.following import expressions_of
from mdstopo.case.design.movable import placed
from mdstopo.case.model import Case, Following, MovablePoints, Variable, VolumeRow
from mdstopo.case.reader import Document
from mdstopo.case.text.errors import CaseError
from mdstopo.case.text.words import number_text

#: what places of points do not depend on, and what masses, loads and velocities do not
_BESIDE_POINTS = (
    "members", "joints", "bushings", "contacts", "design", "objectives", "combine", "constraints", "uncertainty", "fit",
    "optimizer", "solver",
)  # fmt: skip
BESIDE_SCENE = ("points", *_BESIDE_POINTS)
#: how far names are shifted for the places of points, relative to their size: right to rounding in sixth order
SHIFT = 1e-2
#: weights of a central difference of sixth order, by how many shifts
SIXTH = ((1.0, 0.75), (2.0, -0.15), (3.0, 1.0 / 60.0))


class DesignMap:
    """The map between designs of a case (N + P,) and designs of the case that scenes are made of (N + P',).

    case: the latter. Its variables are those of the former that are no names, then numbers of laws and coordinates of
    points that follow from the names, then the names from which masses, loads and velocities follow.
    """

    def __init__(self, stated: Case) -> None:
        assert stated.follows is not None
        follows = stated.follows
        self._stated = stated
        self._laws = follows.of_kind("law")
        self._of_laws = expressions_of(follows, self._laws)
        self._points = _Points(stated)
        scene = follows.of_kind("scene")
        self._of_scene = _names_of(stated, scene)
        own = [each for each in stated.variables if not each.defined]
        plain = [each for each in own if not each.points]
        coordinates = [each for each in own if each.points]
        in_scene = [replace(each, reached=(), moved=(), cost=0.0) for each in self._of_scene]
        variables = (*plain, *self._varied_laws(), *coordinates, *self._points.variables, *in_scene)
        self.case = replace(
            stated,
            variables=variables,
            movable=(*stated.movable, *self._points.movable),
            constraints=tuple(
                replace(row, prices=np.zeros(0)) if isinstance(row, VolumeRow) else row for row in stated.constraints
            ),
            follows=replace(follows, numbers=scene, names=tuple(each.defined for each in in_scene)) if scene else None,
        )
        self._find_places(own)

    def _varied_laws(self) -> list[Variable]:
        """Of each number of a law that follows from names a variable."""
        laws = {group.name: group.laws for group in self._stated.members}
        found = []
        for each in self._laws:
            value = float(getattr(laws[each.group][each.law], each.parameter))
            where = (each.group,), (each.law,), each.parameter
            found.append(Variable(each.key, *where, "group", 1, value, value, value))
        return found

    def _find_places(self, own: Sequence[Variable]) -> None:
        """Where in the two designs what belongs together stands; own: the variables that are no names."""
        parts, inner, n = self._stated.space.parts, self.case.space.parts, self._stated.n_design
        none: IndexArray = np.zeros(0, dtype=np.intp)
        self._kept = np.concatenate([np.arange(n), *(_places(parts[each.name]) for each in own)])
        self._at = np.concatenate([np.arange(n), *(_places(inner[each.name]) for each in own)])
        named = self._stated.defined_variables
        self._names = np.array([parts[each.name].start for each in named], dtype=np.intp)
        self._at_laws = np.array([inner[each.key].start for each in self._laws], dtype=np.intp)
        self._at_points = np.concatenate([none, *(_places(inner[each.name]) for each in self._points.variables)])
        self._kept_scene = np.array([parts[each.name].start for each in self._of_scene], dtype=np.intp)
        self._at_scene = np.array([inner[each.name].start for each in self._of_scene], dtype=np.intp)
        self._x = np.zeros(len(named))
        self._values = np.zeros(len(self._laws))

    def design(self, stated: FloatArray) -> FloatArray:
        """The design (N + P',) of scenes for a stated one (N + P,), at which `pull_back` is from now on."""
        self._x = stated[self._names]
        self._values = self._of_laws.values(self._x)
        design = np.empty(self.case.space.length)
        design[self._at] = stated[self._kept]
        design[self._at_laws] = self._values
        design[self._at_points] = self._points.at(self._x)
        design[self._at_scene] = stated[self._kept_scene]
        return design

    def pull_back(self, rows: FloatArray) -> FloatArray:
        """(..., N + P): derivatives by the stated design of what has the derivatives rows (..., N + P')."""
        out = np.zeros((*rows.shape[:-1], self._stated.space.length))
        out[..., self._kept] = rows[..., self._at]
        out[..., self._names] += rows[..., self._at_laws] @ self._of_laws.slopes(self._x)
        out[..., self._kept_scene] += rows[..., self._at_scene]
        if len(self._at_points):
            out[..., self._names] += rows[..., self._at_points] @ self._points.slopes(self._x)
        return out

    def why_not(self, gradient: bool) -> str:
        """Why the design that was mapped last, or a derivative there, cannot be computed; empty where it can."""
        finite = np.isfinite(self._of_laws.slopes(self._x)).all(axis=1) if gradient else np.isfinite(self._values)
        if finite.all():
            return ""
        key = self._laws[int(finite.argmin())].key
        return f"{key} {'has an infinite slope' if gradient else 'has no finite value'}"


class _Points:
    """The coordinates of points that follow from names, in the axes of their bodies: as those of movable points.

    variables, movable: what they are in the case that scenes are made of.
    """

    def __init__(self, stated: Case) -> None:
        assert stated.follows is not None
        self._stated = stated
        self._numbers = stated.follows.of_kind("points")
        self._expressions = expressions_of(stated.follows, self._numbers)
        self._grids = tuple(dict.fromkeys(each.grid for each in self._numbers))
        self._there = CasesWith(stated, self._numbers, _BESIDE_POINTS) if self._grids else None
        named = stated.defined_variables
        self._least = np.array([SHIFT * (each.upper - each.lower) for each in named])
        #: the names that places of points depend on
        self._moving = [v for v, each in enumerate(named) if each.moved]
        self.variables: list[Variable] = []
        self.movable: list[MovablePoints] = []
        self._slopes: tuple[bytes, FloatArray] | None = None
        for grid in self._grids:
            local = stated.points[grid].local
            axes = [f"{grid} along {axis}" for axis in ("x", "y", "z")[: local.shape[1]]]
            self.movable.append(
                MovablePoints(grid, stated.points[grid].body, np.zeros((1, len(axes))), np.eye(len(axes)), tuple(axes))
            )
            self.variables += [
                Variable(name, (), (), name, "point", len(local), local[:, a], -np.inf, np.inf, unit="m", points=grid)
                for a, name in enumerate(axes)
            ]

    def at(self, x: FloatArray) -> FloatArray:
        """(C,) the coordinates at names x (V,), in the order of `variables`."""
        return self._read(self._expressions.values(x)) if self._grids else np.zeros(0)

    def slopes(self, x: FloatArray) -> FloatArray:
        """(C, V): their derivatives by the names at x (V,).

        By differences of sixth order along the tangent of the expressions, which never leave what they may be.
        """
        if self._slopes is None or self._slopes[0] != x.tobytes():
            values, tangents = self._expressions.values(x), self._expressions.slopes(x)
            size = np.maximum(SHIFT * np.abs(x), self._least)
            out = np.zeros((sum(each.count for each in self.variables), len(x)))
            for v in self._moving:
                way = size[v] * tangents[:, v]
                for shifts, weight in SIXTH:
                    apart = self._read(values + shifts * way) - self._read(values - shifts * way)
                    out[:, v] += weight / size[v] * apart
            self._slopes = x.tobytes(), out
        return self._slopes[1]

    def _read(self, values: FloatArray) -> FloatArray:
        """(C,) the coordinates with other numbers (K,) in the place of the expressions."""
        assert self._there is not None
        points = self._there.at(values).points
        return np.concatenate([points[grid].local.ravel(order="F") for grid in self._grids])


class CasesWith:
    """The case at other values of the numbers that follow from names, without some of its sections."""

    def __init__(self, case: Case, numbers: Sequence[Following], without: tuple[str, ...] = ()) -> None:
        self._document = Document(case.text, path=case.path, overrides=case.overrides)
        self._keys = [each.key for each in numbers]
        self._without = without

    def at(self, values: FloatArray) -> Case:
        """The case with values (K,) of the numbers. Raises CaseError where they are no case."""
        return self._document.case(self._without, dict(zip(self._keys, values.tolist(), strict=True)))


def refuse_bounds(case: Case) -> None:
    """Refuse bounds of names at which places, masses, loads or velocities are no case (CaseError, where they stand)."""
    assert case.follows is not None
    numbers = [each for each in case.follows.numbers if each.kind != "law"]
    if not numbers:
        return
    expressions = expressions_of(case.follows, numbers)
    there = CasesWith(case, numbers, _BESIDE_POINTS)
    named = case.defined_variables
    bounds = np.array([[each.lower, each.upper] for each in named]).T
    start = np.concatenate([each.initials for each in named])
    corners = [(named[0], row) for row in bounds]
    for v, each in enumerate(named):
        corners += [(each, np.where(np.arange(len(named)) == v, row, start)) for row in bounds]
    for variable, x in corners:
        try:
            there.at(expressions.values(x))
        except CaseError as error:
            where = ", ".join(f"{each.defined} = {number_text(value)}" for each, value in zip(named, x, strict=True))
            words = f"within the bounds, at {where}: {error.mistakes[0].path_key}: {error.mistakes[0].message}"
            mistake = case.marks.mistake(f"design.variables.{variable.name}", words)
            raise CaseError([mistake], str(case.path or case.name)) from None


def _names_of(case: Case, numbers: Sequence[Following]) -> list[Variable]:
    """The variables that some numbers follow from."""
    assert case.follows is not None
    expressions = expressions_of(case.follows, numbers)
    words = {word for k in range(len(numbers)) for word in expressions.depends(k)}
    return [each for each in case.variables if each.defined in words]


def as_designed(case: Case, design: FloatArray) -> Case:
    """The case with points where a design (N + P,) has them, its variables beginning there (`movable.placed`)."""
    if case.follows is None:
        return placed(case, design)
    design_map = DesignMap(case)
    there = placed(design_map.case, design_map.design(design))
    values = case.space.named(design)
    begun = [
        replace(each, initial=values[each.name] if each.points else float(values[each.name][0]))
        for each in case.variables
    ]
    rows = [
        replace(row, coefficients=now.coefficients)
        if isinstance(row, VolumeRow) and isinstance(now, VolumeRow)
        else row
        for row, now in zip(case.constraints, there.constraints, strict=True)
    ]
    return replace(case, points=there.points, members=there.members, variables=tuple(begun), constraints=tuple(rows))


def _places(part: slice) -> IndexArray:
    return np.arange(part.start, part.stop, dtype=np.intp)
