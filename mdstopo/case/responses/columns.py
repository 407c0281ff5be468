"""What the columns of states and reactions are called, in a plane and in space."""

from __future__ import annotations

from mdstopo.case.model import Case

_PLANE = ("x", "y", "psi")
#: position and unit quaternion; velocities and accelerations, of the centre of mass and then angular, all global
_PLACES, _RATES = ("x", "y", "z", "qw", "qx", "qy", "qz"), ("x", "y", "z", "turn_x", "turn_y", "turn_z")


def point_columns(case: Case) -> tuple[str, ...]:
    """Names of the coordinates of a point, for columns of tables."""
    return ("x", "y", "z")[: case.dimension]


def state_columns(case: Case, name: str) -> list[str]:
    """Names of the columns of q, v or a: `body.column` of all bodies."""
    own = _PLANE if case.dimension == 2 else _PLACES if name == "q" else _RATES
    return [f"{body.name}.{column}" for body in case.bodies for column in own]


def reaction_columns(case: Case) -> list[str]:
    """Names of the components of the force and moment in a joint, for columns of tables."""
    return ["Fx", "Fy", "M"] if case.dimension == 2 else ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]


def state_units(case: Case) -> dict[str, str]:
    """The unit of each dataset of a trajectory, by its name."""
    places = "m, rad" if case.dimension == 2 else "m, 1"
    return {"t": "s", "q": places, "v": "m/s, rad/s", "a": "m/s^2, rad/s^2", "lambda": "N, N m"}
