"""What in a scene is worth a second look before anything runs: what nothing holds, odd scales, bodies left behind,
mirrored points in another order, steps too long."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import GROUND, Case, LoadCase
from mdstopo.cli.check_numbers import depths, growing_rates
from mdstopo.cli.output import number

if TYPE_CHECKING:
    from mdstopo.scene.vibration_modes import Modes

Floats = NDArray[np.float64]

#: ratio of two lengths of a scene, or of a radius of gyration and a body, from which they hardly belong together
ODD = 100.0
#: gravity beyond which it is hardly one, m/s^2
HEAVY = 1000.0
#: how near a point has to be to touch, and how far a body moves while another stands that should travel with it, in
#: the size of the larger of both
TOUCHING, MOVED_AWAY = 0.02, 5.0
#: relative difference up to which two members are as long as each other
ALIKE = 1e-6
#: steps that a period has at least, to be seen at all
STEPS_PER_PERIOD = 10.0


def odd_scales(case: Case) -> list[str]:
    """Lengths, inertias and gravity that differ so much that one may be in other units; a question each."""
    found = []
    lengths = sorted(_lengths(case))
    if lengths and lengths[-1][0] > ODD * lengths[0][0]:
        (least, small), (most, large) = lengths[0], lengths[-1]
        found.append(f"{large} of {number(most, 3)} m beside {small} of {number(least, 3)} m: are some in millimetres?")
    for body in case.bodies:
        reach = _reach(case, body.name)
        moment = float(np.trace(np.atleast_2d(body.inertia))) / (1.0 if case.dimension == 2 else 3.0)
        radius = float(np.sqrt(moment / body.mass))
        if reach > 0.0 and not reach / ODD < radius < ODD * reach:
            found.append(
                f"body {body.name}: by its inertia its mass is {number(radius, 3)} m from its centre, "
                f"its points are within {number(reach, 3)} m: is the inertia in kg m^2?"
            )
    for load_case in case.load_cases:
        size = float(np.linalg.norm(load_case.gravity))
        if size > HEAVY:
            found.append(f"gravity of {number(size, 4)} m/s^2 in load case {load_case.name}: is it in mm/s^2?")
    return found


def left_behind(case: Case) -> list[str]:
    """Bodies that stand at the start and touch one that moves, so fast that it will be far away; a question each.

    Of two bodies that travel together one may have been given its velocity alone.
    """
    found = []
    for contact, depth in zip(case.contacts, depths(case), strict=True):
        names = contact.body, contact.edge_body
        reach = max((_reach(case, name) for name in names if name != GROUND), default=0.0)
        if not (depth > -TOUCHING * reach).any():
            continue
        for load_case in case.load_cases:
            driven = {motion.body for motion in load_case.motions}
            starts = {body.name: body for body in load_case.bodies}
            speeds = [float(np.linalg.norm(starts[name].velocity)) if name in starts else 0.0 for name in names]
            away = max(speeds) * (load_case.end - load_case.start)
            stands = names[int(np.argmin(speeds))]
            if min(speeds) > 0.0 or not away > MOVED_AWAY * reach > 0.0 or stands in driven or stands == GROUND:
                continue
            moves = names[int(np.argmax(speeds))]
            found.append(
                f"body {stands} stands at the start of load case {load_case.name}, {moves}, which it touches (contact "
                f"{contact.name}), moves at {number(max(speeds), 3)} m/s: has it a velocity, too?"
            )
    return found


def unlike_partners(case: Case) -> list[str]:
    """Mirrored groups whose members have the same lengths, but not member by member; a question each.

    Partners of a symmetric design are as long as each other; points that are listed in another order on one side pair
    members that are no images.
    """
    found = []
    for names in case.mirrored:
        first, *others = (group for group in case.members if group.name in names)
        for other in others:
            apart = np.abs(first.length - other.length)
            unlike = np.flatnonzero(apart > ALIKE * first.length.max(initial=0.0))
            alike = np.allclose(np.sort(first.length), np.sort(other.length), rtol=ALIKE, atol=0.0)
            if alike and len(unlike):
                k = int(unlike[0])
                found.append(
                    f"{len(unlike)} of {len(apart)} mirrored members of {first.name} and {other.name} differ in length "
                    f"from their partners, as number {k + 1} does ({number(first.length[k], 4)} and "
                    f"{number(other.length[k], 4)} m), though both groups have the same lengths: are the points of one "
                    f"in another order?"
                )
    return found


def _lengths(case: Case) -> Iterator[tuple[float, str]]:
    """Lengths that tell of the scene's size, in m, and whose they are."""
    for group in case.members:
        if len(group):
            yield float(group.length.max()), f"members ({group.name})"
    for name in (GROUND, *(body.name for body in case.bodies)):
        spread = [float(np.ptp(grid.local, axis=0).max()) for grid in case.points.values() if grid.body == name]
        if max(spread, default=0.0) > 0.0:
            yield max(spread), f"points of {name}"


def _reach(case: Case, body: str) -> float:
    """How far the points of a body are from its centre of mass at most, m; 0 without points."""
    grids = [grid.local for grid in case.points.values() if grid.body == body]
    for group in case.members:
        grids += [ends for name, ends in ((group.body_from, group.from_local), (group.body_to, group.to_local))
                  if name == body]  # fmt: skip
    return max((float(np.linalg.norm(points, axis=1).max()) for points in grids if len(points)), default=0.0)


def unrestrained(case: Case, load_case: LoadCase) -> list[tuple[str, ...]]:
    """Bodies that are tied to each other but to nothing that stands or is driven, a tuple for each such set."""
    held = {GROUND, *(motion.body for motion in load_case.motions)}
    home = {name: name for name in (GROUND, *(body.name for body in case.bodies))}

    def root(name: str) -> str:
        while home[name] != name:
            name = home[name]
        return name

    ties: tuple[Any, ...] = (*case.joints, *case.bushings)
    pairs = [(group.body_from, group.body_to) for group in case.members if len(group)]
    pairs += [(tie.bodies[0], tie.bodies[1]) for tie in ties]
    pairs += [(contact.body, contact.edge_body) for contact in case.contacts]
    for one, other in pairs:
        home[root(one)] = root(other)
    tied = {root(name) for name in held}
    sets: dict[str, list[str]] = {}
    for body in case.bodies:
        if root(body.name) not in tied:
            sets.setdefault(root(body.name), []).append(body.name)
    return [tuple(names) for names in sets.values()]


def restraint(case: Case, load_case: LoadCase, modes: "Modes", bodies: tuple[str, ...]) -> dict[str, Any]:
    """Bodies that move without stiffness in small motion about the start, and motions that grow.

    bodies: whose freedoms the modes' shapes have, in their order. `free`: sets of bodies that nothing holds, which move
    as a whole; `loose`: how many other modes have no stiffness; `movers`: what moves in them, where they are all that
    have none; `growing`: the modes of negative stiffness, each with its rate in 1/s and what moves most.
    """
    free = unrestrained(case, load_case)
    none = np.flatnonzero(np.abs(modes.squares) <= modes.least)
    movers = [] if free else sorted({_mover(case, modes.shapes[:, k], bodies) for k in none})
    return {
        "free": [list(names) for names in free],
        "loose": max(len(none) - len(free) * (3 if case.dimension == 2 else 6), 0),
        "movers": movers,
        "growing": [
            {"rate": float(rate), "mover": _mover(case, modes.shapes[:, k], bodies)}
            for k, rate in enumerate(growing_rates(modes))
        ],
    }


def in_words(found: dict[str, Any]) -> list[str]:
    """The result of `restraint`, one sentence each."""
    told = [
        f"nothing holds {' and '.join(names)}: no member, joint, bushing or contact leads to ground or to a driven body"
        for names in found["free"]
    ]
    if found["loose"]:
        where = f" (most of it: {', '.join(found['movers'])})" if found["movers"] else ""
        told.append(f"{_modes(found['loose'])} no stiffness at the start{where}")
    told += [
        f"a mode of negative stiffness at the start grows with {number(each['rate'], 3)}/s "
        f"(most of it: {each['mover']})"
        for each in found["growing"]
    ]
    return told


def _modes(count: int) -> str:
    return "one mode has" if count == 1 else f"{count} modes have"


def _mover(case: Case, shape: Floats, bodies: tuple[str, ...]) -> str:
    """The body that has most of a mode's kinetic energy, and along or about what it moves."""
    each = 3 if case.dimension == 2 else 6
    energies, words = [], []
    for k, name in enumerate(bodies[: len(shape) // each]):
        if name == GROUND:
            continue
        body, own = case.body(name), shape[each * k : each * k + each]
        moments = [body.inertia] if each == 3 else np.linalg.eigvalsh(body.inertia).tolist()
        masses = np.array([body.mass] * (each - len(moments)) + list(moments))
        parts = masses * own**2
        energies.append(float(parts.sum()))
        kinds = ["along x", "along y", "turning"] if each == 3 else ["along x", "along y", "along z"] + 3 * ["turning"]
        words.append(f"{name} {kinds[int(parts.argmax())]}")
    return words[int(np.argmax(energies))]


def fastest_mover(case: Case, modes: "Modes", bodies: tuple[str, ...]) -> tuple[float, str] | None:
    """The fastest vibration about the start, rad/s, and the body that has most of it; None where nothing vibrates."""
    fastest = float(modes.squares.max(initial=0.0))
    if fastest <= modes.least:
        return None
    return float(np.sqrt(fastest)), _mover(case, modes.shapes[:, int(modes.squares.argmax())], bodies)


def long_step(case: Case, modes: "Modes", bodies: tuple[str, ...]) -> str:
    """Why a fixed step is too long for the fastest vibration about the start, by name; nothing where it is not."""
    step, found = case.solver.step, fastest_mover(case, modes, bodies)
    if step is None or found is None:
        return ""
    rate, mover = found
    period = 2.0 * np.pi / rate
    if period >= STEPS_PER_PERIOD * step:
        return ""
    return (
        f"solver.step of {number(step)} s is {number(period / step, 2)} to a period of the fastest vibration, "
        f"{number(rate, 4)} rad/s ({mover}); where it matters, take at most {number(period / STEPS_PER_PERIOD, 2)} s"
    )
