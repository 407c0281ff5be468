"""The hand calculation of cargo securing: IMO, CSS Code, Annex 13, advanced calculation method, beside the simulation.

Forces in kN, masses in t, lengths in m, as in the Code. x forward, y to port, z up from the deck; the origin is the
middle of the cargo's base. Of the Code's tables only what the example of Appendix 1 needs is here.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.hand import HANDS, places
from benchmarks.scenes import CASES
from mdstopo import Case, evaluate, load_case
from mdstopo.bench.tables import Table, verdict
from mdstopo.case.model import ResponseRow
from mdstopo.store.design_files import read_design

Floats = NDArray[np.float64]

G = 9.81
#: calculated strength (7.2, 7.3): MSL by this, where horizontal angles are left out and where they are taken
PLAIN, ANGLED = 1.5, 1.35
#: what of the lashings counts against tipping
TIPPING = 0.9
#: basic accelerations (table 2) on deck, low, at 0.7 L: longitudinal, transverse, vertical, in m/s2
BASIC = (2.9, 6.3, 6.2)
#: kN/m2 of wind on the side, and of spray up to 2 m above the deck
WIND, SPRAY, SPRAYED = 1.0, 1.0, 2.0
#: port and starboard, forward and aft
SIDES = (1, -1)
#: chains of the case: MSL in kN, and the size from which one counts
MSL, PRESENT = 90.0, 0.02


@dataclass(frozen=True)
class Voyage:
    """A ship: length, breadth and metacentric height in m, speed in knots."""

    length: float
    breadth: float
    gm: float
    speed: float

    def factor(self) -> float:
        """The correction of the basic accelerations for length and speed, to the two digits that table 3 has.

        Raises ValueError for a stiff ship, B / GM below 13, whose accelerations are larger (table 4).
        """
        if self.breadth / self.gm < 13.0:
            raise ValueError(f"B / GM is {self.breadth / self.gm:.3g}: below 13 table 4 of the Annex is needed")
        root = 0.345 * self.speed / math.sqrt(self.length)
        return round(root + (58.62 * self.length - 1034.5) / self.length**2, 2)


@dataclass(frozen=True)
class Unit:
    """A cargo unit: mass in t, length along the ship, width across it, height; the lever arm of tipping in m."""

    mass: float
    length: float
    width: float
    height: float
    arm: float
    friction: float


@dataclass(frozen=True)
class Lashing:
    """What one lashing may count with, CS in kN; its ends on the cargo and on the deck."""

    strength: float
    lug: tuple[float, float, float]
    ring: tuple[float, float, float]

    def along(self) -> Floats:
        """The direction from the cargo to the deck, of length 1."""
        way = np.subtract(self.ring, self.lug)
        return np.asarray(way / np.linalg.norm(way))

    def angles(self) -> tuple[float, float]:
        """The vertical angle and the horizontal one from athwart, in rad."""
        x, y, z = self.along()
        return math.atan2(-z, math.hypot(x, y)), math.atan2(abs(x), abs(y))

    def lever(self, unit: Unit) -> float:
        """The arm c about the lower edge on the other side, over which the unit would tip athwart."""
        _, y, z = self.along()
        side = math.copysign(1.0, y)
        return float((side * self.lug[1] + 0.5 * unit.width) * -z + self.lug[2] * abs(y))


VOYAGE = Voyage(length=120.0, breadth=20.0, gm=1.4, speed=15.0)
UNIT = Unit(mass=62.0, length=6.0, width=4.0, height=4.0, arm=1.8, friction=0.3)


def external_forces(voyage: Voyage, unit: Unit) -> tuple[float, float, float]:
    """Fx, Fy, Fz (7.1): inertia with the slope of the deck, wind and spray."""
    sprayed = min(unit.height, SPRAYED)
    open_to = [WIND * unit.height * wide + SPRAY * sprayed * wide for wide in (unit.width, unit.length)] + [0.0]
    x, y, z = (unit.mass * a * voyage.factor() + more for a, more in zip(BASIC, open_to, strict=True))
    return x, y, z


def factor_of(vertical: float, friction: float, horizontal: float = 0.0) -> float:
    """f: what a lashing does against sliding, by its strength; horizontal: its angle from the way of sliding (rad)."""
    return math.cos(vertical) * math.cos(horizontal) + friction * math.sin(vertical)


def athwart(unit: Unit, lashings: Sequence[Lashing], side: int) -> float:
    """What holds against sliding to the side across (7.3): friction and the lashings on this side, port 1 or -1."""
    held = [each for each in lashings if each.along()[1] * side > 1e-9]
    return unit.friction * unit.mass * G + sum(
        each.strength * factor_of(each.angles()[0], unit.friction, each.angles()[1]) for each in held
    )


def lengthwise(unit: Unit, lashings: Sequence[Lashing], end: int, lift: float) -> float:
    """The same along the ship, of the lashings at this end, forward 1 or -1; lift: Fz, which takes from the weight."""
    held = [each for each in lashings if each.along()[0] * end > 1e-9]
    return unit.friction * (unit.mass * G - lift) + sum(
        each.strength * factor_of(each.angles()[0], unit.friction, 0.5 * math.pi - each.angles()[1]) for each in held
    )


def against_tipping(unit: Unit, lashings: Sequence[Lashing], side: int) -> float:
    """What holds against tipping to the side across, in kN m (7.2)."""
    held = [each for each in lashings if each.along()[1] * side > 1e-9]
    return 0.5 * unit.width * unit.mass * G + TIPPING * sum(each.strength * each.lever(unit) for each in held)


def lashings_of(case: Case, alpha: Floats) -> list[Lashing]:
    """The chains of a design; a smaller chain counts with its share."""
    found = []
    for group in case.design_groups:
        own = alpha[case.group_slices[group.name]]
        for k in np.flatnonzero(own >= PRESENT):
            lug, ring = group.from_world[group.from_index[k]], group.to_world[group.to_index[k]]
            ends = [(float(x), float(y), float(z)) for x, y, z in (lug, ring)]
            found.append(Lashing(float(own[k]) * MSL / ANGLED, *ends))
    return found


def twelve(case: Case) -> Floats:
    """As few whole chains as the Code needs: four at either side and two at either end, all at 40 degrees."""
    alpha = np.array(case.lower)
    steep = {part: [ends for ends in own if ends[0][2] > 2.0] for part, own in HANDS["cargo"].items()}
    for _, members in places(case, steep):
        alpha[members] = 1.0
    return alpha


def securing() -> Iterator[Table]:
    """The Annex's balances of designs of `cases/cargo.yaml`, beside what the motion says of them."""
    case = load_case(CASES / "cargo.yaml")
    fx, fy, fz = external_forces(VOYAGE, UNIT)
    files = {"hand": "cargo-hand", "found": "cargo"}
    designs = {"twelve": twelve(case)}
    designs |= {name: read_design(CASES / "designs" / f"{file}.txt", case.n_design) for name, file in files.items()}
    chains = {name: lashings_of(case, alpha) for name, alpha in designs.items()}
    balances = (
        ("sliding athwart, kN", fy, [[athwart(UNIT, own, side) for side in SIDES] for own in chains.values()]),
        ("sliding along, kN", fx, [[lengthwise(UNIT, own, end, fz) for end in SIDES] for own in chains.values()]),
        (
            "tipping athwart, kN m", fy * UNIT.arm,
            [[against_tipping(UNIT, own, side) for side in SIDES] for own in chains.values()],
        ),
    )  # fmt: skip
    rows = [
        [what, f"{needed:.0f}", *(f"{min(each):.0f}" for each in held), verdict(np.min(held) >= needed)]
        for what, needed, held in balances
    ]
    yield Table(
        "What Annex 13 says of the designs",
        ("against", "external", *(f"held by {name}" for name in chains), "met by all"),
        rows,
        (
            f"The weaker of the two sides or ends. Chains count with MSL / {ANGLED:g} times their size, with their "
            f"angles in both planes (7.3); all of Fz = {fz:.0f} kN is taken from the weight.",
        ),
    )
    yield _in_motion(case, designs)


def _in_motion(case: Case, designs: dict[str, Floats]) -> Table:
    """How far the cargo goes, and with what chains pull, as the slip of the friction becomes smaller."""
    rows = []
    for slip in (case.contacts[0].slip, 0.001):
        finer = load_case(CASES / "cargo.yaml", overrides={"contacts[0].slip": slip})
        for name, alpha in designs.items():
            found = evaluate(finer, alpha, gradient=False)
            far = [f"{1000 * value:.1f}" for value in found.objectives.values()]
            pulls = {
                load_case: max(
                    found.constraints[i] + row.bound
                    for i, row in enumerate(case.constraints)
                    if isinstance(row, ResponseRow) and row.load_case == load_case
                )
                for load_case in ("rolling", "pitching")
            }
            rows.append([name, f"{1000 * slip:g}", *far, *(f"{each / 1000:.1f}" for each in pulls.values())])
    return Table(
        "What the motion says as friction creeps less",
        ("design", "slip, mm/s", *(f"{each.name}, mm" for each in case.objectives), "rolling, kN", "pitching, kN"),
        rows,
        ("How far the cargo slides, and the largest force of a chain in either load case.",),
    )
