"""A case in a plane as arrays of a general scene: what is planar about them (`dimension`)."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from mdstopo.case.arrays import TimeFormula
from mdstopo.case.model import Case, Joint, Load, LoadCase, Response
from mdstopo.general.scene.contact_compile import edge_rows
from mdstopo.general.scene.dimension import Dimension, Frames, Pairs
from mdstopo.general.scene.timed_loads import TimedPart
from mdstopo.mechanics.contact import PX, PY
from mdstopo.mechanics.joints import joint_table
from mdstopo.mechanics.kinematics.planar import PLANAR
from mdstopo.mechanics.kinematics.timed import MOMENT, PUSH
from mdstopo.scene.compile_scene import home_of
from mdstopo.scene.loads import Loads, generalised_loads
from mdstopo.scene.springs_model import HOME_COS, FloatArray, IndexArray

#: numbers of a response
RESPONSE_PAR = 4
#: numbers of a bushing (`GeneralModel.bushing`)
BUSHING = 12


def _masses(body: Any) -> list[float]:
    return [body.mass, body.mass, body.inertia]


def _velocities(body: Any, home: FloatArray) -> list[float]:
    del home
    return [*body.velocity, body.angular_velocity]


def _stated(home: FloatArray) -> FloatArray:
    """x, y, psi of all bodies: an angle is stated as a whole."""
    return home[:, : PLANAR.coordinates].ravel()


def _places(home: FloatArray, body: int, points: FloatArray) -> FloatArray:
    x, y, _, c, s = home[body]
    return np.asarray(np.array([x, y]) + points @ np.array([[c, s], [-s, c]]))


def _loads(load_case: LoadCase, index: dict[str, int], times: FloatArray, frames: Frames, keep: bool = False) -> Loads:
    del frames
    return generalised_loads(load_case, index, times, keep)


def _timed(load: Load, frames: Frames) -> Iterator[TimedPart]:
    """Components of the force, and the moment, that are formulas of time."""
    del frames
    follows = int(load.frame == "body")
    for signal, direction in zip(load.force, ((1.0, 0.0), (0.0, 1.0)), strict=True):
        if isinstance(signal, TimeFormula):
            yield TimedPart(signal, PUSH, follows, direction, tuple(load.at_local))
    if isinstance(load.moment, TimeFormula):
        yield TimedPart(load.moment, MOMENT, 0, (), ())


def _bushings(case: Case, index: dict[str, int], pairs: Pairs, home: FloatArray) -> tuple[IndexArray, FloatArray]:
    """The pair (n_bushing,) and the parameters (n_bushing, BUSHING) of each bushing (`GeneralModel.bushing`)."""
    where, rows = [], []
    for bushing in case.bushings:
        a, b = (index[name] for name in bushing.bodies)
        where.append(pairs.setdefault((a, b), len(pairs)))
        apart = joint_table.apart_at_home(home, a, b, bushing.at_first, bushing.at_second)
        c, s = home[a, HOME_COS:]
        x, y = c * apart[0] + s * apart[1], c * apart[1] - s * apart[0]
        rows.append([*bushing.at_first, *bushing.at_second, x, y, *bushing.stiffness, *bushing.damping])
    return np.array(where, dtype=np.int64), np.array(rows, dtype=np.float64).reshape(-1, BUSHING)


def _reaches(contact: FloatArray) -> FloatArray:
    return np.asarray(np.hypot(contact[:, PX], contact[:, PY]))


def _joint_row(joint: Joint, home: FloatArray, first: int, second: int, frames: Frames) -> list[float]:
    del frames
    return joint_table.parameters(joint, home, first, second)


def _response_row(response: Response, frames: Frames) -> list[float]:
    """The point, if it has one, and then the response's own numbers."""
    del frames
    row = [*(response.at_local or ()), *response.numbers]
    return row + [0.0] * (RESPONSE_PAR - len(row))


PLANE = Dimension(
    kinematics=PLANAR,
    point=2,
    axes=("x", "y", "angle"),
    components={"x": 0, "y": 1, "norm": 2},
    response_par=RESPONSE_PAR,
    home=home_of,
    frames=lambda load_case: {},
    masses=_masses,
    velocities=_velocities,
    stated=_stated,
    places=_places,
    loads=_loads,
    timed=_timed,
    bushings=_bushings,
    half_turn=lambda pairs, home, q: None,
    contacts=edge_rows,
    reaches=_reaches,
    joint_code=joint_table.code_of,
    joint_kernels=joint_table.kernels_of,
    has_norm=lambda kind: joint_table.kernels_of(kind).force_rows > 1,
    joint_row=_joint_row,
    response_row=_response_row,
)
