"""Numbers with units in quotes become the same case as their SI numbers; wrong units are mistakes with a place."""

import math
import re

import pytest

from mdstopo.case.keys.kinds import NUMBER
from mdstopo.case.model import Table
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.case.text.quantities import QuantityError, in_si

CASE = """
format: 1
gravity: [0, {gravity}]
time: {{end: {end}}}
bodies:
  b: {{mass: {mass}, inertia: {inertia}, position: [{x}, 0], angle: {angle}}}
  a: {{mass: 1, inertia: 1, position: [9, 9], angular_velocity: {rate}}}
points:
  p: {{body: b, grid: {{list: [[{x}, {y}], [0, 1]]}}}}
  g: {{body: ground, grid: {{list: [[0, 2], [1, 2]]}}}}
members: {{m: {{from: g, to: p, law: {{type: spring, stiffness: {stiffness}, free_length: {free}}}}}}}
bushings: [{{bodies: [ground, b], at: [0, 0], stiffness: [{stiffness}, 0, {turning}]}}]
loads:
  - {{body: b, force: [{{table: [[0, 0], [{half}, {force}]]}}, {{formula: sin(w*t), parameters: {{w: {factor}}}}}]}}
objectives: {{G: {{response: energy}}}}
"""
SI = {
    "gravity": "-9.80665", "end": "0.5", "mass": "12.5", "inertia": "2", "x": "0.04", "y": "0.3048", "angle": "0.25",
    "stiffness": "2500", "free": "0.035", "turning": "7", "half": "0.25", "force": "4448.2216152605", "rate": "2",
    "factor": "3",
}  # fmt: skip
UNITS = {
    "gravity": '"-9.80665 m/s^2"', "end": '"500 ms"', "mass": '"12500 g"', "inertia": '"2 kg m²"', "x": '"40 mm"',
    "y": '"1 ft"', "angle": '"250 mrad"', "stiffness": '"2.5 N/mm"', "free": '"3.5 cm"', "turning": '"7 N m/rad"',
    "half": '"0.25 s"', "force": '"1000 lbf"', "rate": '"2 1/s"',
    "factor": "3",
}  # fmt: skip


def test_a_case_with_units_is_the_same_as_in_si_to_the_bit() -> None:
    plain, measured = (read_case(CASE.format(**values)) for values in (SI, UNITS))
    for part in ("bodies", "members", "bushings", "load_cases", "points"):
        assert getattr(plain, part) == getattr(measured, part)
    signal = measured.load_cases[0].loads[0].force[0]
    assert isinstance(signal, Table)
    assert signal.times.tolist() == [0.0, 0.25]


@pytest.mark.parametrize(
    ("text", "needed", "value"),
    [
        ("35 mm", "m", 0.035),
        ("30 deg", "rad", math.pi / 6),
        ("60 rpm", "rad/s", 2 * math.pi),
        ("1 rev/s", "rad/s", 2 * math.pi),
        ("36 km/h", "m/s", 10.0),
        ("1 in", "m", 0.0254),
        ("1 J", "N m", 1.0),
        ("2e3 g*m/s**2", "N", 2.0),
        ("3 N s/m", "N s/m", 3.0),
        ("5 1/s", "rad/s", 5.0),
    ],
)
def test_units_have_their_international_factors(text: str, needed: str, value: float) -> None:
    assert in_si(text, needed) == pytest.approx(value, rel=1e-15, abs=0)


@pytest.mark.parametrize(
    ("key", "value", "path", "words"),
    [
        ("mass", '"12 mm"', "bodies.b.mass", ["'12 mm'", "in kg"]),
        ("mass", '"12 kgg"', "bodies.b.mass", ["'kgg'", "g, N", "prefix"]),
        ("mass", '"-12 kg"', "bodies.b.mass", ["> 0"]),
        ("x", '"4 kg"', "bodies.b.position[0]", ["in m"]),
        ("force", '"4 s"', "loads[0].force[0].table[1][1]", ["in N"]),
        ("half", '"4 N"', "loads[0].force[0].table[1][0]", ["in s"]),
        ("turning", '"7 N/m"', "bushings[0].stiffness[2]", ["in N m/rad"]),
        ("end", '"4 m/"', "time.end", ["no unit"]),
        ("end", '"0.5"', "time.end", ["a quoted number is text"]),
        ("rate", '"20 Hz"', "bodies.a.angular_velocity", ["in rad/s", "rev/s or rpm, not in Hz"]),
        ("factor", '"20 Hz"', "loads[0].force[1].parameters.w", ["units are read where a key has one of its own"]),
    ],
)
def test_a_wrong_unit_is_a_mistake_with_its_place(key: str, value: str, path: str, words: list[str]) -> None:
    with pytest.raises(CaseError) as caught:
        read_case(CASE.format(**{**SI, key: value}))
    assert path in [mistake.path_key for mistake in caught.value.mistakes]
    told = next(mistake.message for mistake in caught.value.mistakes if mistake.path_key == path)
    for word in words:
        assert word in told


def test_a_prescribed_angle_is_no_length() -> None:
    motion = "motions: [{{body: b, {}: {{velocity: {}}}}}]\n"
    moved = read_case(CASE.format(**SI) + motion.format("angle", '"90 deg/s"')).load_cases[0].motions[0].angle
    assert moved is not None
    assert moved.signal == math.pi / 2
    for coordinate, value in (("angle", '"1 m/s"'), ("x", '"1 rad/s"')):
        with pytest.raises(CaseError, match="measures the same"):
            read_case(CASE.format(**SI) + motion.format(coordinate, value))


@pytest.mark.parametrize(
    ("row", "bound"),
    [
        ('response: energy, limit: "3 kJ"', 3000.0),
        ('response: {displacement: {body: b}}, limit: "250 mm"', 0.25),
        ('response: {angle: {body: b}}, over_time: max_abs, at_least: "90 deg"', math.pi / 2),
        ('response: energy, over_time: integral, limit: "2 J s"', 2.0),
    ],
)
def test_bounds_of_responses_have_the_units_of_these(row: str, bound: float) -> None:
    (found,) = read_case(CASE.format(**SI) + f"constraints: [{{{row}}}]\n").constraints
    assert found.bound == bound


def test_bounds_in_another_unit_are_mistakes() -> None:
    with pytest.raises(CaseError, match="in J, or in a unit that measures the same"):
        read_case(CASE.format(**SI) + 'constraints: [{response: energy, limit: "3 mm"}]\n')


def test_a_number_whose_key_has_no_unit_takes_none() -> None:
    text = CASE.format(**SI) + 'constraints: [{volume: all, limit: "3 m"}]\n'
    with pytest.raises(CaseError, match="units are read where a key has one"):
        read_case(text)


@pytest.mark.parametrize(
    ("text", "unit"), [("40 mm", "m"), ("-9.8 m/s^2", "m/s^2"), ("1e3N", "N"), ("30°", "rad"), ("5 1/s", "rad/s")]
)
def test_the_schema_lets_editors_accept_what_the_reader_does(text: str, unit: str) -> None:
    assert re.search(NUMBER.schema()["pattern"], text)
    assert math.isfinite(in_si(text, unit))


@pytest.mark.parametrize("text", ["40", "mm", "40 =2", ""])
def test_neither_takes_what_has_no_number_or_no_unit(text: str) -> None:
    assert not re.search(NUMBER.schema()["pattern"], text)
    with pytest.raises(QuantityError):
        in_si(text, "m")


@pytest.mark.parametrize("text", ["1e999999999 m", "1e-999999999 m", "1 km^999999999", "1" * 5000 + " m", "1e308 km"])
def test_numbers_and_powers_without_end_are_refused_at_once(text: str) -> None:
    with pytest.raises(QuantityError):
        in_si(text, "m")


def test_what_is_written_from_a_case_has_its_numbers_in_si() -> None:
    from mdstopo.finalize.document import content_of
    from mdstopo.finalize.lift_case import lifted

    text = CASE.format(**UNITS).replace('angle: "250 mrad"', "angle: 0")
    case = read_case(text)
    content = content_of(case)
    assert content["bodies"]["b"]["position"] == [0.04, 0]
    assert content["loads"][0]["force"][0]["table"][1] == [0.25, 4448.2216152605]
    spatial = read_case(lifted(case))
    assert spatial.bodies[0].position == (0.04, 0.0, 0.0)
    assert spatial.load_cases[0].gravity == (0.0, -9.80665, 0.0)
