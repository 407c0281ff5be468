"""Members from every point of one grid to every point of another: the same as if they were any members."""

import numpy as np
import pytest

import mdstopo.sensitivity.springs_driver
from mdstopo.engine import Evaluator
from mdstopo.scene import compile_scene
from mdstopo.scene.grid_members import STRIDE, row_of
from mdstopo.scene.packing import chunks_of
from mdstopo.status import Status
from tests.engine.scenes import INTERIOR, paper, read, with_solver


def grids(p, q, group=None, law=None, **more):
    """Two bodies, p points on one joined with q on the other, and a few members of no grid beside."""
    return {
        "gravity": [0, -9.8],
        "time": {"end": 0.2},
        "bodies": {
            "hull": {"mass": 40, "inertia": 8, "position": [0, 0.1], "angle": 0.3},
            "deck": {"mass": 900, "inertia": 700, "position": [0.2, -1.2]},
        },
        "points": {
            "p": {"body": "hull", "grid": {"line": {"from": [-0.3, 0.2], "to": [0.4, 0.3], "count": p}}},
            "q": {"body": "deck", "grid": {"line": {"from": [-1, -1.1], "to": [1.2, -1], "count": q}}},
        },
        "members": {
            "before": {"from": "p", "to": {"body": "deck", "at": [3, 0]}, "law": {"type": "spring", "stiffness": 3}},
            "web": {
                "from": "p", "to": "q", "law": {"type": "spring", "stiffness": 4e5 / (p * q), **(law or {})},
                **(group or {}),
            },
            "after": {"from": {"body": "hull", "at": [0, 2]}, "to": "q", "law": {"type": "spring", "stiffness": 2}},
        },
        "loads": [{"body": "deck", "acceleration": [9.8, 0], "angular_acceleration": 20}],
        "design": {"initial": 0.4, "lower": 0},
        "objectives": {"G": {"response": "energy"}, "I": {"response": "energy", "over_time": "integral"}},
        "combine": {"weights": {"G": 1, "I": 1}},
        **more,
    }  # fmt: skip


def blocks(case):
    return Evaluator(case).scenes["default"].model.block.tolist()


def rows(case, which=1):
    return tuple(blocks(case)[which][6:])


@pytest.mark.parametrize(
    ("p", "q", "row"),
    [
        (20, 51, (56, 51)),
        (4, 32, (32, 32)),
        (7, 2 * STRIDE, (2 * STRIDE + 8, 2 * STRIDE)),  # a row more than that would lie on the last's lines
        (3, 51, (0, 0)),  # too few rows
        (30, 15, (16, 15)),
        (30, 8, (0, 0)),  # one vector alone
        (30, 17, (0, 0)),  # too much padding
    ],
)
def test_rows_are_made_where_they_pay(p, q, row):
    assert rows(read(grids(p, q))) == row


def test_rows_need_all_pairs_and_no_damping_and_no_preload():
    assert rows(read(grids(20, 20, {"max_length": 1.5}))) == (0, 0)
    assert rows(read(grids(20, 20, {"connect": "pairs"}))) == (0, 0)
    assert rows(read(grids(20, 32, law={"damping": 0.1}))) == (0, 0)
    assert rows(read(grids(20, 32, law={"preload": 0.1}))) == (0, 0)
    assert rows(read(grids(20, 32, {"max_length": 99}))) == (32, 32)  # a limit that leaves all


def both_ways(case, design, monkeypatch, **asked):
    found = Evaluator(case).evaluate(design, **asked)
    with monkeypatch.context() as patch:
        patch.setattr(compile_scene, "row_of", lambda *_: (0, 0))
        flat = Evaluator(case)
        assert not any(block[6] for block in flat.scenes["default"].model.block.tolist())
        return found, flat.evaluate(design, **asked)


#: counts that rounding decides: of iterations that go on until it is all that is left
ROUNDING = ("body_iterations",)
OF_FIXED_STEPS = ("body_iterations", "force_sums", "tangents", "newton_corrections", "spring_states")


def assert_alike(found, plain, tolerance=1e-12, ignored=ROUNDING):
    assert found.status.ok, found.message
    assert {k: v for k, v in found.work.items() if k not in ignored} == {
        k: v for k, v in plain.work.items() if k not in ignored
    }
    for name, value in plain.objectives.items():
        assert found.objectives[name] == pytest.approx(value, rel=tolerance)
        slope = plain.gradients[name]
        assert np.abs(found.gradients[name] - slope).max() <= tolerance * np.abs(slope).max()


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta", "generalized_alpha"])
@pytest.mark.parametrize(
    ("p", "q"),
    [(20, 51), (70, 32), (5, 2 * STRIDE)],  # one tile; tiles of rows, the last one short; of columns
)
def test_objectives_and_gradients_are_those_of_members_in_no_order(p, q, integrator, monkeypatch):
    case = read(grids(p, q), integrator=integrator)
    assert rows(case)[0] > 0
    design = np.random.default_rng(p).uniform(0.01, 1.0, case.n_design)
    if integrator == "generalized_alpha":
        assert_alike(*both_ways(case, design, monkeypatch), 1e-9, OF_FIXED_STEPS)
    else:
        assert_alike(*both_ways(case, design, monkeypatch))


@pytest.mark.parametrize("method", ["direct", "iterative"])
def test_other_sensitivities_are_those_of_members_in_no_order(method, monkeypatch):
    case = read(grids(9, 20), integrator="generalized_alpha" if method == "iterative" else "auto")
    design = np.random.default_rng(1).uniform(0.01, 1.0, case.n_design)
    assert_alike(*both_ways(case, design, monkeypatch, sensitivity=method), 1e-9, OF_FIXED_STEPS)


def test_constant_load_s_gradient_is_that_of_members_in_no_order(monkeypatch):
    case = paper("fig6")
    design = np.random.default_rng(2).uniform(0.01, 1.0, case.n_design)
    found, plain = both_ways(case, design, monkeypatch, sensitivity="constant_load")
    slope = plain.gradients["G"]
    assert np.abs(found.gradients["G"] - slope).max() <= 1e-10 * np.abs(slope).max()


@pytest.mark.parametrize("power", [1, 2])
@pytest.mark.parametrize("threads", [1, 3])
def test_chunks_of_rows_give_what_whole_blocks_do(threads, power, monkeypatch):
    monkeypatch.setenv("MDSTOPO_THREADS", str(threads))
    case = read(grids(150, 151, design={"initial": 0.4, "power": power}), tolerance=1e-4)
    first = blocks(case)[1]
    assert first[6:] == [152, 151]
    cut = [chunk for chunk in chunks_of(np.array(blocks(case))).tolist() if chunk[0] == 1]
    assert len(cut) > 3
    assert all((start - first[1]) % 152 == 0 for _, start, _ in cut)
    assert [cut[0][1], cut[-1][2]] == first[1:3]
    design = np.random.default_rng(3).uniform(0.01, 1.0, case.n_design)
    assert_alike(*both_ways(case, design, monkeypatch), 1e-11)


def test_a_fixed_grid_moves_the_bodies_and_has_no_gradient(monkeypatch):
    case = read(grids(20, 51, {"design": False}))
    design = np.random.default_rng(4).uniform(0.01, 1.0, case.n_design)
    assert case.n_design == 71
    assert_alike(*both_ways(case, design, monkeypatch))


@pytest.mark.parametrize(("absent", "fewer"), [(0.4, False), (0.6, True)])
def test_members_that_carry_nothing_are_left_out_of_a_grid_where_it_pays(absent, fewer, monkeypatch):
    case = read(grids(20, 51))
    rng = np.random.default_rng(5)
    design = rng.uniform(0.01, 1.0, case.n_design)
    design[rng.random(case.n_design) < absent] = 0.0
    evaluator = Evaluator(case)
    found = evaluator.evaluate(design)
    count = np.count_nonzero(design) if fewer else case.n_design
    assert found.work["spring_states"] == count * found.work["force_sums"]
    with monkeypatch.context() as patch:
        patch.setattr(compile_scene, "row_of", lambda *_: (0, 0))
        plain = Evaluator(case).evaluate(design)
    for name, slope in plain.gradients.items():
        assert np.abs(found.gradients[name] - slope).max() <= 1e-12 * np.abs(slope).max()


def test_the_member_of_a_grid_that_meets_its_other_end_is_named():
    # points 0.1 m apart on both bodies, which pass each other 0.03 m beside; but for point 11, moved onto point 4's way
    def passing(*line):
        scene = grids(9, 20, gravity=[0, 0], loads=[])
        scene["bodies"]["hull"] = {"mass": 40, "inertia": 8, "position": [0, 1], "velocity": [0, -10]}
        scene["bodies"]["deck"] = {"mass": 900, "inertia": 700, "position": [0, 0]}
        first = {"line": {"from": [-0.53, 1], "to": [0.27, 1], "count": 9}}
        scene["points"] = {"p": {"body": "hull", "grid": first}, "q": {"body": "deck", "grid": list(line)}}
        scene["members"] = {"web": {"from": "p", "to": "q", "law": {"type": "spring", "stiffness": 1e-9}}}
        return read(scene, integrator="gauss")

    case = passing({"line": {"from": [-1.1, 0], "to": [0.8, 0], "count": 20}})
    assert rows(case, 0) == (24, 20)
    assert Evaluator(case).evaluate(np.ones(case.n_design)).status.ok
    upright = {"line": {"from": [-0.13, 0], "to": [-0.13, -0.8], "count": 9}}
    case = passing({"line": {"from": [-1.1, 0], "to": [-0.1, 0], "count": 11}}, upright)
    found = Evaluator(case).evaluate(np.ones(case.n_design))
    assert found.status is Status.ZERO_LENGTH
    assert f"member {4 * 20 + 11} of group web" in found.message


def test_inner_peaks_of_a_grid_are_those_of_members_in_no_order(monkeypatch):
    case = with_solver(paper("fig6", *INTERIOR), tolerance=1e-9)
    design = np.random.default_rng(6).uniform(0.01, 1.0, case.n_design)
    assert_alike(*both_ways(case, design, monkeypatch), 1e-10)


def test_the_engine_makes_its_scenes_of_grids():
    # what the tests above replace is what the engine calls
    assert mdstopo.sensitivity.springs_driver.compile_members is compile_scene.compile_members
    assert compile_scene.row_of is row_of
