"""The comparison with other programs: what they are given, how they are timed, what is told where one is missing."""

import json
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import mdstopo
from mdstopo.bench.peers import NotACheckoutError, load
from mdstopo.bench.reference import Reference
from mdstopo.bench.scenes import plate
from mdstopo.case.reader import load_case, read_case
from mdstopo.cli.group import run_group

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT))

from benchmarks.peers import ours, ours_seat, scenes, settings, tables  # noqa: E402
from benchmarks.peers.peak import highest  # noqa: E402
from benchmarks.peers.problem import GROUND, Problem, coefficients, moments, world  # noqa: E402
from benchmarks.peers.race import Entry, Field, Measured, race  # noqa: E402
from benchmarks.peers.table import OURS, PEERS, PEERS_OF_SEAT, Peer  # noqa: E402
from benchmarks.peers.translate import NotForPeersError, problem_of  # noqa: E402
from benchmarks.peers.translate_seat import seat_problem_of  # noqa: E402
from benchmarks.scenes import scene  # noqa: E402

FAKE = {"fake": Peer("tests.bench.fake_peer", ()), "gone": Peer("nowhere", ("a_package_that_nobody_has",))}


def field():
    problem = problem_of(read_case(plate(100)))
    designs = [np.full(problem.members, size) for size in (0.1, 0.2)]
    truths = [Reference(float(np.sum(problem.stiffness * alpha)), problem.stiffness) for alpha in designs]
    return Field(problem, designs, truths)


def measured(peer, error, seconds, **setting):
    return Measured(Entry(peer, setting), error, error, [seconds] * 3, [seconds] * 3, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("name", ["fig6", "ring"])
def test_the_arrays_are_the_case(name):
    case = scene("fig6") if name == "fig6" else read_case(scenes.ring())
    problem = problem_of(case)
    assert problem.members == case.n_design
    again = read_case(json.dumps(ours.case_of(problem)))
    alpha = np.random.default_rng(3).uniform(0.05, 1.0, case.n_design)
    one, two = (mdstopo.evaluate(each, alpha) for each in (case, again))
    assert two.objectives["G"] == pytest.approx(one.objectives["G"], rel=1e-9)
    np.testing.assert_allclose(two.gradients["G"], one.gradients["G"], atol=1e-8 * np.abs(one.gradients["G"]).max())


def test_the_ring_is_a_closed_loop_of_ten_bodies_with_a_thousand_members():
    problem = problem_of(read_case(scenes.ring()))
    assert (problem.bodies, problem.members, len(problem.hinges)) == (10, 1000, 11)
    for bodies, points in zip(problem.hinges.tolist(), problem.at, strict=True):
        one, two = (world(problem.start, body, at[None]) for body, at in zip(bodies, points, strict=True))
        np.testing.assert_allclose(one, two, atol=1e-14)
    loop = {frozenset(pair) for pair in problem.hinges.tolist() if GROUND not in pair}
    assert loop == {frozenset((k, (k + 1) % 10)) for k in range(10)}


def test_the_seated_occupant_hangs_together_where_the_case_has_it(tmp_path):
    case = load_case(scenes.SEAT, overrides=scenes.SEAT_CHANGES)
    seat_problem_of(case).save(tmp_path / "problem.npz")
    problem = Problem.load(tmp_path / "problem.npz")
    bodies = case.bodies[1:]
    np.testing.assert_allclose(
        problem.place + problem.reach.sum(axis=1), [body.position for body in bodies], atol=1e-14
    )
    ends = np.array([bodies[k].position for k in problem.body]) + problem.at
    lengths = [np.linalg.norm(ends - problem.anchor, axis=1)[problem.law == law] for law in (0, 1)]
    gaps = [length for group in case.members if group.name != "retractors" for length in group.length]
    np.testing.assert_allclose(lengths[0], gaps, rtol=1e-12)
    np.testing.assert_allclose(lengths[1], case.members[7].length, rtol=1e-12)
    assert (len(problem.body), problem.members) == (31, case.n_design)


def test_the_seated_occupant_of_jax_moves_as_ours():
    """Second order in the step, as the forces of stops and belts have kinks."""
    if PEERS_OF_SEAT["jax"].missing():
        pytest.skip("jax is not installed")
    case = load_case(scenes.SEAT, overrides=scenes.SEAT_CHANGES)
    problem, alpha = seat_problem_of(case), np.array(case.initial)
    exact, _ = ours_seat.make(problem, tolerance=1e-8)(alpha, False)
    course = Field(problem, [alpha], [Reference(exact, alpha)])
    entries = [Entry("jax", {"steps": steps}, gradient=False) for steps in (250, 1000)]
    (found,) = race(course, entries, rounds=1, seconds=0.0, peers=PEERS_OF_SEAT)
    coarse, fine = (each.value_error for each in found)
    assert coarse < 2e-5
    assert fine < 2e-6


def test_moments_times_coefficients_are_squared_lengths():
    random = np.random.default_rng(1)
    p, q = random.normal(size=(2, 7, 2))
    pose = random.normal(size=(2, 3))
    expected = ((world(pose, 1, q) - world(pose, 0, p)) ** 2).sum(axis=1)
    np.testing.assert_allclose(moments(p, q) @ np.array(coefficients(*pose, np.cos, np.sin)), expected, rtol=1e-12)


def test_a_problem_survives_being_written(tmp_path):
    problem = problem_of(read_case(scenes.ring()))
    problem.save(tmp_path / "problem.npz")
    again = Problem.load(tmp_path / "problem.npz")
    assert (again.end, again.peak) == (problem.end, problem.peak)
    np.testing.assert_array_equal(again.at, problem.at)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"members.belts.law.damping": 1}, "undamped"),
        ({"design.power": 2}, "power"),
        ({"objectives.G.over_time": "mean"}, "maximum"),
        ({"bodies.torso.velocity": [1, 0]}, "at rest"),
        ({"loads": [{"body": "torso", "force": [{"table": [[0, 0], [1, 1]]}, 0]}]}, "constant"),
    ],
)
def test_what_the_peers_were_not_written_for_is_refused(change, said):
    with pytest.raises(NotForPeersError, match=said):
        problem_of(read_case(plate(100), overrides=change))


def test_every_peer_gets_all_designs_and_is_timed_at_each():
    entries = [Entry("fake", {"factor": 1.0}), Entry("fake", {"factor": 1.5}), Entry("fake", gradient=False)]
    told = []
    found = race(field(), entries, told.append, rounds=2, seconds=0.0, peers=FAKE)
    assert [[each.entry for each in own] for own in found] == [entries, entries]
    for exact, wrong, forward in found:
        assert exact.value_error == exact.gradient_error == 0.0
        assert (wrong.value_error, wrong.gradient_error) == (pytest.approx(0.5), pytest.approx(0.5))
        assert forward.gradient_error is None
        assert forward.error == forward.value_error == 0.0
        for each in (exact, wrong, forward):
            assert len(each.rounds) == len(each.processor) == 2
            low, high = each.quartiles
            assert 0.0 < low <= each.seconds <= high


def test_what_does_not_work_is_left_out_with_a_sentence():
    entries = [Entry("gone"), Entry("fake", {"broken": "make"}), Entry("fake"), Entry("fake", {"broken": "end"})]
    told = []
    one, two = race(field(), [*entries, Entry("fake")], told.append, rounds=1, seconds=0.0, peers=FAKE)
    assert one == two == []  # the last of them ended the process of all
    said = "\n".join(told)
    assert "gone is left out: a_package_that_nobody_has not installed (pip install 'mdstopo[peers]')" in said
    assert "broken make, is left out: RuntimeError: cannot be made" in said
    assert "broken end, is left out: its process ended with status 3" in said


def test_a_broken_setting_does_not_hinder_the_others():
    entries = [Entry("fake", {"broken": "make"}), Entry("fake")]
    one, two = race(field(), entries, lambda _: None, rounds=1, seconds=0.0, peers=FAKE)
    assert [each.entry for each in one] == [each.entry for each in two] == entries[1:]


def test_settings_are_of_programs_that_there_are():
    every = [*settings.ring(), *settings.million(), *settings.any_case(False), *settings.any_case(True)]
    every += [entry for flag in (True, False) for entry in (*settings.two_bodies(flag), *settings.forward(flag))]
    assert {entry.peer for entry in every} == set(PEERS)
    for entry in every:
        assert entry.gradient <= PEERS[entry.peer].gradient
    assert {entry.peer for entry in settings.seat()} == set(PEERS_OF_SEAT)
    assert all(find_spec(peer.module) for peer in (*PEERS.values(), *PEERS_OF_SEAT.values()))


def test_the_standings_name_the_fastest_and_whether_the_bar_is_met():
    found = [
        measured(OURS, 1e-7, 0.001, tolerance=1e-5),
        measured(OURS, 1e-12, 0.003, tolerance=1e-9),
        measured("jax", 1e-7, 0.010, steps=4),
        measured("jax", 1e-9, 0.012, steps=8),
        measured("scipy", 1e-9, 0.500),
    ]
    shown = tables.standings("t", [("s", found)], (1e-6, 1e-8, 1e-10), bar=0.2)
    assert [row[4] for row in shown.rows] == ["jax", "jax", "none"]
    assert [row[7] for row in shown.rows] == ["0.10", "0.25", ""]
    assert [row[9] for row in shown.rows] == ["yes", "NO", ""]
    shown = tables.against_each("t", found, bar=0.01)
    assert [row[9] for row in shown.rows] == ["NO", "NO", "yes"]
    assert len(tables.every_setting("t", found).rows) == len(found)


def test_fixed_steps_stand_beside_fixed_steps_only():
    found = [
        measured(OURS, 1e-7, 0.002, tolerance=1e-5),
        measured(OURS, 1e-7, 0.001, step=0.1),
        measured("jax", 1e-6, 0.010, steps=4),
        measured("casadi", 1e-6, 0.010, tolerance=1e-6),
    ]
    shown = tables.against_each("t", found, bar=0.15)
    assert [row[4] for row in shown.rows] == ["step 0.1", "tolerance 1e-05"]
    assert [row[9] for row in shown.rows] == ["yes", "NO"]


def test_a_picture_has_a_line_for_each_program(tmp_path):
    pytest.importorskip("matplotlib")
    from benchmarks.peers.picture import draw

    found = [measured(OURS, 1e-7, 0.001), measured("jax", 1e-7, 0.010), measured("jax", 0.0, 0.020)]
    draw([("one", found), ("two", found)], tmp_path / "picture.svg")
    assert (tmp_path / "picture.svg").read_text().count(">jax<") == 1


def test_the_highest_peak_between_looks():
    times = np.linspace(0.0, 2.0, 21)
    place, inside = highest(np.sin(3.0 * times), 3.0 * np.cos(3.0 * times), 2.0)
    assert inside
    assert place == pytest.approx(np.pi / 6.0, abs=1e-4)
    assert highest(times**2, 2.0 * times, 2.0) == (2.0, False)
    # a start from rest is no peak
    assert highest(np.cos(times), -np.sin(times), 2.0)[1] is False


@pytest.mark.parametrize("name", ["jax", "diffrax", "casadi", "scipy"])
@pytest.mark.parametrize("kind", ["fig6", "interior"])
def test_installed_peers_compute_the_same(name, kind):
    if PEERS[name].missing():
        pytest.skip(f"{name} is not installed")
    case = scene(kind)
    exact = mdstopo.evaluate(case, case.initial)
    course = Field(problem_of(case), [np.array(case.initial)], [Reference(exact.objectives["G"], exact.gradients["G"])])
    setting = {"steps": 8} if name == "jax" else {"tolerance": 1e-9}
    ((found,),) = race(course, [Entry(name, setting)], rounds=1, seconds=0.0)
    assert found.value_error < 1e-6
    assert found.gradient_error < 1e-5


@pytest.mark.parametrize("name", ["exudyn", "mujoco"])
def test_installed_peers_run_forward(name):
    if PEERS[name].missing():
        pytest.skip(f"{name} is not installed")
    case = scene("end")
    exact = mdstopo.evaluate(case, case.initial)
    course = Field(problem_of(case), [np.array(case.initial)], [Reference(exact.objectives["G"], exact.gradients["G"])])
    ((found,),) = race(course, [Entry(name, gradient=False)], rounds=1, seconds=0.0)
    assert found.value_error < 1e-3


def test_a_package_without_its_checkout_says_what_to_do(tmp_path):
    with pytest.raises(NotACheckoutError, match="needs a checkout"):
        load(tmp_path)
    assert load().__module__ == "benchmarks.peers.command"


def test_the_command_refuses_what_it_cannot_compare(tmp_path, capsys):
    case = tmp_path / "damped.yaml"
    case.write_text(plate(100).replace("type: spring,", "type: spring, damping: 1,"))
    for arguments, said in (
        (["work-precision", str(case), "--peers"], "only undamped springs"),
        (["skip", "--peers"], "takes no --peers"),
        (["work-precision", "--peers", "--set", "time.end=1"], "--set needs CASE"),
    ):
        assert run_group(["bench", *arguments]) == 2
        assert said in capsys.readouterr().err
