"""Units of what is looked at, for axes and attributes."""

from mdstopo.case.aims import Objective, Response

_UNITS = {
    "energy": "J",
    "displacement": "m",
    "velocity": "m/s",
    "acceleration": "m/s^2",
    "angle": "rad",
    "angular_velocity": "rad/s",
    "angular_acceleration": "rad/s^2",
    "member_force": "N",
    "joint_force": "N",
    "joint_moment": "N m",
}


def unit_of(response: Response) -> str:
    """The unit of a response."""
    return _UNITS[response.kind]


def unit_of_value(objective: Objective) -> str:
    """The unit of a response reduced over time."""
    unit = unit_of(objective.response)
    return f"{unit} s" if objective.over_time == "integral" else unit


def words(response: Response) -> str:
    """A response in words: `displacement x of torso relative to vehicle`."""
    parts = [response.kind.replace("_", " ")]
    if response.component not in (None, "norm"):
        parts.append(str(response.component))
    for key, value in (("of", response.body or response.joint), ("in", response.group)):
        if value is not None:
            parts.append(f"{key} {value}")
    if response.relative_to not in (None, "ground"):
        parts.append(f"relative to {response.relative_to}")
    return " ".join(parts)
