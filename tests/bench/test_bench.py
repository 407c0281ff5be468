"""The benchmarks measure what they say, and what is left out is left out."""

import json

import pytest

from mdstopo.bench import profile, skip, work_precision
from mdstopo.bench.scaling import exponent, whole_run
from mdstopo.bench.scenes import chain, plate
from mdstopo.case.reader import read_case
from mdstopo.cli.group import run_group


@pytest.mark.parametrize(
    "omission",
    [skip.fixed_members, skip.undamped, skip.zero_weight, skip.shared_load_case, skip.reverse_from_the_peak],
)
def test_less_work_is_done(omission):
    found = omission()
    assert 0 < found.left_out.work < found.full.work


@pytest.mark.parametrize("omission", [skip.inactive_members, skip.prescribed_body, skip.no_joints])
def test_less_work_is_done_in_general_scenes(omission):
    found = omission()
    assert 0 < found.left_out.work < found.full.work


def test_a_weight_of_zero_halves_the_work_of_two_load_cases():
    found = skip.zero_weight()
    assert found.left_out.work <= 0.6 * found.full.work


def test_sharing_a_load_case_is_worth_two_simulations_of_three():
    found = skip.shared_load_case()
    assert 3 * found.left_out.work == found.full.work


def test_scenes_have_the_size_that_is_asked_for():
    for members in (100, 1_020, 10_000):
        assert read_case(plate(members)).n_members == pytest.approx(members, rel=0.05)
    case = read_case(chain(7))
    assert (len(case.bodies), len(case.joints), case.n_members) == (7, 7, 7)


def test_an_exponent_is_the_slope_of_logarithms():
    sizes = [10.0, 100.0, 1000.0]
    assert exponent(sizes, [3.0 * size**1.5 for size in sizes]) == pytest.approx(1.5)


BOUNCE = """
format: 1
gravity: [0, -10]
time: {end: 1}
bodies: {ball: {mass: 2, inertia: 1, position: [0, 1]}}
motions: [{body: ball, x: {velocity: 0}, angle: {velocity: 0}}]
members:
  floor:
    from: {body: ground, at: [0, -1]}
    to: {body: ball, at: [0, 1]}
    law: {type: gap, stiffness: 5000, gap: 0.8, side: compression}
design: {initial: 1}
objectives: {deep: {response: {displacement: {body: ball}}, over_time: max}}
"""


def test_a_profile_tells_all_force_sums_and_all_the_time():
    sums, times = profile.profile(read_case(BOUNCE))
    counts = {row[0]: int(row[1].replace(",", "")) for row in sums.rows}
    assert sum(counts.values()) == 2 * counts["all"]
    assert 0 < counts["where within a step a member switches"] < counts["stages of steps"]
    parts = {row[0]: float(row[1]) for row in times.rows}
    assert parts["all"] > 0.0
    assert parts["Python"] < parts["all"]
    assert parts["motion: force sums, with solutions for accelerations"] > 0.0


def test_a_profile_of_springs_between_free_bodies_names_what_is_called():
    sums, times = profile.profile(read_case(plate(100)))
    assert sums.rows[0][1] == sums.rows[-1][1]
    assert sum(float(row[2].rstrip("%")) for row in times.rows[:-1]) == pytest.approx(100.0, abs=15.0)


def test_no_call_is_timed_any_more_after_a_profile():
    before = profile.Entry.__call__, profile.Entry.prepare
    with pytest.raises(RuntimeError, match="ends here"), profile.compiled_calls():
        raise RuntimeError("ends here")
    assert (profile.Entry.__call__, profile.Entry.prepare) == before


def test_a_whole_run_is_measured():
    seconds, peak, file = whole_run(plate(100), iterations=2)
    assert seconds > 0.0
    assert 1e7 < peak < 1e9
    assert file > 1_000


def test_work_and_precision(monkeypatch, tmp_path):
    monkeypatch.setattr(work_precision, "TOLERANCES", (1e-4, 1e-8))
    monkeypatch.setattr(work_precision, "TOLERANCES_FIXED", (1e-3,))
    monkeypatch.setattr(work_precision, "_ROUNDS", 1)
    case = read_case(plate(100))
    points = list(work_precision.work_precision(case))
    assert {point.integrator for point in points} == {"gauss", "runge_kutta", "generalized_alpha"}
    for point in points:
        assert point.seconds > 0.0
        assert point.gradient_error < (100.0 if point.integrator == "generalized_alpha" else 1.0) * point.tolerance
    shown = work_precision.table(case, points)
    assert len(shown.rows) == len(points)
    pytest.importorskip("matplotlib")
    work_precision.draw(case, points, tmp_path / "picture.svg")
    assert "<svg" in (tmp_path / "picture.svg").read_text()


def test_the_command_gives_its_tables_as_json(capsys):
    assert run_group(["bench", "scaling", "--members", "0", "--bodies", "0", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["tables"] == []
    assert run_group(["bench", "skip", "case.yaml"]) == 2
