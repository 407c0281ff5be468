"""The case: what the user wrote, typed, immutable, defaults filled in, everything in SI units.

Body coordinates are relative to the centre of mass, along axes that turn with the body. World coordinates are
the global frame's, in the configuration at the start. Pairs are tuples (x, y); what is longer is a read-only
array. The fixed body is called ``ground``: it is not among `Case.bodies`, its frame is the global one.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mdstopo.case.arrays import (
    Components,
    FloatArray,
    FrozenDict,
    IndexArray,
    Pair,
    Signal,
    Table,
    Triple,
    VectorSignal,
    read_only,
)
from mdstopo.case.geometry.rigid_bodies import AnyBody, Body, SpatialBody
from mdstopo.case.joints import JOINTS, DistanceJoint, FixedJoint, Joint, PrismaticJoint, RevoluteJoint
from mdstopo.case.joints.spatial_joint import SpatialJoint
from mdstopo.case.laws import (
    LAWS,
    ActuatorLaw,
    CrushLaw,
    CubicLaw,
    CurveLaw,
    GapLaw,
    InerterLaw,
    Law,
    PulseLaw,
    SpringLaw,
    TableLaw,
)
from mdstopo.case.objects.design_space import DesignSpace, slots_of, units_of
from mdstopo.case.objects.fitting import Fit
from mdstopo.case.objects.parts import (
    AnyContact,
    Bushing,
    Candidates,
    Contact,
    Load,
    LoadCase,
    MemberGroup,
    Motion,
    MovablePoints,
    PointGrid,
    Prescribed,
    PrescribedRotation,
    Surface,
    SurfaceContact,
)
from mdstopo.case.objects.problem_parts import (
    Combine,
    Following,
    Follows,
    Objective,
    OptimizerSettings,
    ReducedResponse,
    Response,
    ResponseRow,
    SolverSettings,
    Variable,
    VolumeRow,
)
from mdstopo.case.objects.uncertain import Uncertainty
from mdstopo.case.text.errors import Mistake
from mdstopo.case.text.marks import Marks
from mdstopo.case.text.words import GROUND
from mdstopo.case.value import Value, frozen
from mdstopo.shown import counted, html_of

__all__ = [
    "GROUND",
    "JOINTS",
    "LAWS",
    "ActuatorLaw",
    "AnyBody",
    "AnyContact",
    "Body",
    "Bushing",
    "Candidates",
    "Case",
    "Combine",
    "Components",
    "Contact",
    "CrushLaw",
    "CubicLaw",
    "CurveLaw",
    "DistanceJoint",
    "Fit",
    "FixedJoint",
    "FloatArray",
    "Following",
    "Follows",
    "FrozenDict",
    "GapLaw",
    "IndexArray",
    "InerterLaw",
    "Joint",
    "Law",
    "Load",
    "LoadCase",
    "Marks",
    "MemberGroup",
    "Motion",
    "MovablePoints",
    "Objective",
    "OptimizerSettings",
    "Pair",
    "PointGrid",
    "Prescribed",
    "PrescribedRotation",
    "PrismaticJoint",
    "PulseLaw",
    "ReducedResponse",
    "Response",
    "ResponseRow",
    "RevoluteJoint",
    "Signal",
    "SolverSettings",
    "SpatialBody",
    "SpatialJoint",
    "SpringLaw",
    "Surface",
    "SurfaceContact",
    "Table",
    "TableLaw",
    "Triple",
    "Uncertainty",
    "Variable",
    "VectorSignal",
    "VolumeRow",
]


@frozen
class Case(Value):
    """One design problem as read from a file, in SI units.

    text, sha256: the YAML as read and its hash; overrides: keys set from outside, key path -> value in YAML;
    files: paths of included files as written -> sha256 of their bytes. warnings: what the reader accepts but
    the user should know. uncertainty: None where all is certain; the other fields are the nominal case. shared: groups
    whose members have one alpha; mirrored: groups whose members k have one; variables: parameters of laws and defined
    names that are varied, then coordinates of points; movable: the points whose these are; follows: what follows from
    these names, None where no name is varied. fit: what `mdstopo fit` estimates.
    dimension: 2 in the plane; 3 in space, where bodies are `SpatialBody`, joints `SpatialJoint` and contacts
    `SurfaceContact`.
    """

    title: str
    path: Path | None
    name: str
    text: str
    sha256: str
    overrides: Mapping[str, str]
    files: Mapping[str, str]
    bodies: tuple[AnyBody, ...]
    joints: tuple[Joint, ...]
    bushings: tuple[Bushing, ...]
    points: Mapping[str, PointGrid]
    members: tuple[MemberGroup, ...]
    load_cases: tuple[LoadCase, ...]
    objectives: tuple[Objective, ...]
    combine: Combine | None
    constraints: tuple[VolumeRow | ResponseRow, ...]
    optimizer: OptimizerSettings
    solver: SolverSettings
    marks: Marks
    warnings: tuple[Mistake, ...] = ()
    uncertainty: Uncertainty | None = None
    shared: tuple[str, ...] = ()
    mirrored: tuple[tuple[str, ...], ...] = ()
    variables: tuple[Variable, ...] = ()
    contacts: tuple[AnyContact, ...] = ()
    dimension: int = 2
    fit: Fit | None = None
    movable: tuple[MovablePoints, ...] = ()
    follows: Follows | None = None

    def __repr__(self) -> str:
        parts = [counted(len(self.bodies), "body"), f"{counted(self.n_members, 'member')}, {self.n_design:,} designed"]
        parts += [counted(len(self.joints), "joint")] if self.joints else []
        parts += [f"objectives {', '.join(each.name for each in self.objectives) or 'none'}"]
        parts += [counted(len(self.constraints), "constraint")]
        return f"<Case {self.title or self.name!r}: {'; '.join(parts)}>"

    def _repr_html_(self) -> str:
        return html_of(self)

    @property
    def design_groups(self) -> tuple[MemberGroup, ...]:
        """The groups whose members are design variables, in the order of the design vector."""
        return tuple(group for group in self.members if group.design)

    @property
    def n_design(self) -> int:
        """N, the number of design variables."""
        return sum(len(group) for group in self.design_groups)

    @property
    def objectives_that_count(self) -> tuple[Objective, ...]:
        """The objectives that a run lowers or raises; those of weight 0 are only reported."""
        weights = self.combine.weights if self.combine is not None else {}
        return tuple(each for each in self.objectives if weights.get(each.name, 1.0) > 0.0)

    @property
    def n_members(self) -> int:
        """The number of members of all groups, designed or not."""
        return sum(len(group) for group in self.members)

    @property
    def priced_groups(self) -> tuple[MemberGroup, ...]:
        """The groups whose members are priced, of which only some are built."""
        return tuple(group for group in self.members if group.candidates is not None)

    @property
    def group_slices(self) -> dict[str, slice]:
        """By name of a design group, the slice of the design vector that its members have."""
        slices: dict[str, slice] = {}
        first = 0
        for group in self.design_groups:
            slices[group.name] = slice(first, first + len(group))
            first += len(group)
        return slices

    @property
    def is_optimizable(self) -> bool:
        """Whether there is something to vary and something to improve."""
        return bool(self.objectives) and (self.n_design > 0 or bool(self.variables))

    @property
    def space(self) -> DesignSpace:
        """The map from the optimiser's variables to alpha and the values of variables."""
        counts = {group.name: len(group) for group in self.design_groups}
        slots = slots_of(counts, self.shared, self.mirrored)
        # prices of candidates that are not built are by alpha, and sizes of a catalogue are alphas
        in_alpha = any(group.candidates is not None or group.sizes for group in self.design_groups)
        bounds = [(group.lower, group.upper) for group in self.design_groups]
        units = None if in_alpha else units_of(bounds, list(counts.values()), slots)
        return DesignSpace(self.n_design, slots, self.variables, units)

    @property
    def defined_variables(self) -> tuple[Variable, ...]:
        """The design variables that are names in `define`."""
        return tuple(each for each in self.variables if each.defined)

    @property
    def start(self) -> FloatArray:
        """(N + P,) the initial design: alpha, then the values of variables."""
        values = [each.initials for each in self.variables]
        return read_only(np.concatenate([self.initial, *values])) if values else self.initial

    @property
    def initial(self) -> FloatArray:
        """(N,) initial design; 1 where the case states neither design nor objectives nor constraints."""
        return self._per_member("initial")

    @property
    def lower(self) -> FloatArray:
        """(N,) lower bounds of alpha."""
        return self._per_member("lower")

    @property
    def upper(self) -> FloatArray:
        """(N,) upper bounds of alpha."""
        return self._per_member("upper")

    @property
    def power(self) -> FloatArray:
        """(N,) exponents of alpha in the forces: mu of Eq. 12."""
        return self._per_member("power")

    @property
    def cost(self) -> FloatArray:
        """(N,) what one unit of each alpha adds to a volume: V_i of Eq. 14."""
        groups = self.design_groups
        return read_only(np.concatenate([g.cost for g in groups]) if groups else np.zeros(0))

    def whole(self, design: FloatArray) -> FloatArray:
        """The whole design (N + P,) from alpha (N,), with the initial values of variables behind it; a whole one as it
        is."""
        if self.variables and design.shape == (self.n_design,):
            return np.concatenate([design, self.start[self.n_design :]])
        return design

    def body(self, name: str) -> AnyBody:
        """The body of that name; KeyError where there is none (``ground`` is none)."""
        for body in self.bodies:
            if body.name == name:
                return body
        raise KeyError(name)

    def load_case(self, name: str) -> LoadCase:
        """The load case of that name; KeyError where there is none."""
        for load_case in self.load_cases:
            if load_case.name == name:
                return load_case
        raise KeyError(name)

    def _per_member(self, field: str) -> FloatArray:
        groups = self.design_groups
        values = np.array([getattr(g, field) for g in groups], dtype=np.float64)
        return read_only(np.repeat(values, [len(g) for g in groups]))
