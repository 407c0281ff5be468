"""The Python interface: shapes, mappings, what is refused."""

import copy
import pickle
import subprocess
import sys

import numpy as np
import pytest

import mdstopo
from mdstopo import Case, CaseError, Evaluation, Trajectory, evaluate, load_case, simulate
from mdstopo.case.reader import read_case
from mdstopo.functions import Responses
from tests.engine.scenes import CASES, paper, random_scene, read, spring_scene


def test_dir_shows_every_call_before_any_is_used():
    program = (
        "import mdstopo; shown = {name for name in dir(mdstopo) if name[0] != '_'} | {'__version__'}\n"
        "print(set(mdstopo.__all__) == shown, 'load_case' in vars(mdstopo))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "False"]


def test_reading_a_case_loads_no_engine():
    program = (
        f"import sys, mdstopo; mdstopo.load_case({str(CASES / 'fig6.yaml')!r})\n"
        "heavy = ('mdstopo.api', 'mdstopo.engine', 'mdstopo.optimizer', 'mdstopo.compiler')\n"
        "print([name for name in sys.modules if name.startswith(heavy)])\n"
        "import mdstopo.api; print(mdstopo.load_case is mdstopo.api.load_case)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["[]", "True"]


def test_load_case_reads_a_file_and_overrides():
    case = load_case(CASES / "fig6.yaml", overrides={"solver.integrator": "runge_kutta", "solver.tolerance": 1e-6})
    assert isinstance(case, Case)
    assert (case.solver.integrator, case.solver.tolerance) == ("runge_kutta", 1e-6)
    assert load_case(str(CASES / "fig6.yaml")).solver.integrator == "auto"
    with pytest.raises(CaseError, match="integrator"):
        load_case(CASES / "fig6.yaml", overrides={"solver.integrator": "euler"})


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
def test_simulate_gives_steps_and_any_time_between(integrator):
    motion = simulate(read(random_scene(2, "ground", bodies=3), integrator=integrator))
    assert isinstance(motion, Trajectory)
    n = len(motion.t)
    assert motion.t[0] == 0.05
    assert np.all(np.diff(motion.t) > 0)
    for each in (motion.q, motion.v, motion.a):
        assert each.shape == (n, 9)
    assert motion.lam.shape == (n, 0)
    states = motion.at(np.linspace(motion.t[0], motion.t[-1], 7))
    for each in (states.q, states.v, states.a):
        assert each.shape == (7, 9)
        assert np.all(np.isfinite(each))
    assert states.lam.shape == (7, 0)
    assert motion.at(motion.t[-1]).q.shape == (1, 9)
    assert np.array_equal(motion.at(motion.t).q, motion.q)
    assert motion.at([]).q.shape == (0, 9)
    for bad in ([motion.t[0] - 1e-9], [motion.t[-1] + 1e-9], [np.nan], [[0.1, 0.2]]):
        with pytest.raises(ValueError, match="times"):
            motion.at(bad)


def test_a_trajectory_outlives_the_next_simulation():
    case = read(random_scene(2))
    first = simulate(case)
    before = first.at([0.1, 0.2]).q.copy()
    simulate(case, np.full(case.n_design, 0.01))
    evaluate(case, np.full(case.n_design, 0.9))
    assert np.array_equal(first.at([0.1, 0.2]).q, before)


def test_an_evaluation_outlives_the_next():
    case = read(random_scene(2))
    first = evaluate(case)
    kept = first.gradients["G"].copy()
    evaluate(case, np.full(case.n_design, 0.01))
    assert np.array_equal(first.gradients["G"], kept)
    with pytest.raises(ValueError, match="read-only"):
        first.gradients["G"][0] = 1.0


def test_evaluate_maps_objectives_by_name():
    case = paper("fig7")
    found = evaluate(case)
    assert isinstance(found, Evaluation)
    names = {"G1", "G2"}
    for mapping in (found.objectives, found.gradients, found.peak_times, found.peaks):
        assert set(mapping) == names
    for name in names:
        assert isinstance(found.objectives[name], float)
        assert found.gradients[name].shape == (1020,)
        assert found.peaks[name][0].value == found.objectives[name]
        assert found.peaks[name][0].time == found.peak_times[name]
        assert np.array_equal(found.peaks[name][0].gradient, found.gradients[name])
    assert found.constraints.shape == (1,)
    assert found.constraints == pytest.approx([0.0], abs=1e-10)
    assert found.constraint_gradients.shape == (1, 1020)
    assert np.all(found.constraint_gradients == 1.0)
    assert found.status.ok
    assert found.work["force_sums"] > 0
    without = evaluate(case, gradient=False)
    assert without.objectives == found.objectives
    assert without.gradients == {}
    assert without.peaks["G1"][0].gradient is None


def test_of_several_load_cases_one_must_be_named():
    case = paper("fig7")
    with pytest.raises(ValueError, match="rotation, translation"):
        simulate(case)
    with pytest.raises(ValueError, match="rotation, translation"):
        simulate(case, load_case="vertical")
    assert simulate(case, load_case="rotation").load_case == "rotation"
    assert simulate(paper("fig6")).load_case == "default"


@pytest.mark.parametrize("call", [simulate, evaluate])
@pytest.mark.parametrize(
    ("alpha", "what"),
    [(np.ones(3), "shape"), (0.5, "shape"), (np.full(1020, -1e-9), "at least 0"), (np.full(1020, np.nan), "finite"),
     (np.full(1020, np.inf), "finite")],
    ids=["length", "scalar", "negative", "nan", "infinite"],
)  # fmt: skip
def test_an_unusable_design_is_refused_in_words(call, alpha, what):
    with pytest.raises(ValueError, match=what):
        call(paper("fig6"), alpha)


def test_lists_and_integers_are_designs_too():
    case = read(spring_scene(loads=[{"body": "mass", "force": [10.0, 0.0]}]))
    assert evaluate(case, [1]).objectives == evaluate(case, np.ones(1)).objectives


def test_an_unknown_method_is_refused_and_the_known_are_listed():
    with pytest.raises(ValueError, match="adjoint, direct, iterative, constant_load"):
        evaluate(paper("fig6"), method="avm")


def test_what_the_engine_cannot_do_is_refused_with_its_place():
    scene = spring_scene()
    scene["members"]["spring"]["law"] = {"type": "gap", "stiffness": 1.0, "gap": 0.1}
    for call in (simulate, evaluate):
        with pytest.raises(CaseError, match="gauss does not compute the law gap"):
            call(read(scene, integrator="gauss"))


def test_a_case_without_objectives_is_simulated_at_full_strength():
    scene = spring_scene()
    del scene["objectives"], scene["design"]
    scene["loads"] = [{"body": "mass", "force": [10.0, 0.0]}]
    case = read(scene)
    assert simulate(case).at([1.0]).q[0, 0] == pytest.approx(1.0 + 0.05 * (1 - np.cos(10.0)), abs=1e-7)
    found = evaluate(case)
    assert found.objectives == {}
    assert found.status.ok


def test_names_of_the_package_are_the_apis():
    assert {"load_case", "simulate", "evaluate", "optimize"} <= set(mdstopo.__all__)
    assert mdstopo.evaluate is mdstopo.api.evaluate
    with pytest.raises(AttributeError):
        mdstopo.nothing  # noqa: B018


@pytest.mark.parametrize("call", [simulate, evaluate, mdstopo.optimize])
def test_a_path_in_the_place_of_a_case_is_refused_with_what_makes_one(call):
    with pytest.raises(
        TypeError, match=r"found str 'cases/fig6.yaml', needed is a case, as mdstopo\.load_case gives it"
    ):
        call("cases/fig6.yaml")
    with pytest.raises(TypeError, match="found NoneType, needed is a case"):
        call(None)


def test_overrides_that_are_no_mapping_are_refused_in_words():
    with pytest.raises(TypeError, match="overrides: found list, needed is a mapping"):
        load_case(CASES / "fig6.yaml", ["solver.tolerance=1e-6"])
    with pytest.raises(TypeError, match="overrides: found list, needed is a mapping"):
        read_case((CASES / "fig6.yaml").read_text(), overrides=["solver.tolerance=1e-6"])
    with pytest.raises(TypeError, match="overrides: found list"):
        load_case(CASES / "fig6.yaml", [])


def test_a_complex_design_is_refused_as_its_imaginary_part_would_be_lost():
    case = paper("fig6")
    alpha = np.full(case.n_design, 0.1 + 1e-20j)
    with pytest.raises(ValueError, match="alpha must be real, not complex"):
        evaluate(case, alpha)
    with pytest.raises(ValueError, match="x must be real, not complex"):
        Responses(case).at(alpha)
    scene = spring_scene()
    scene["design"]["variables"] = {"w": {"of": "define.w", "lower": 1.0, "upper": 8.0, "initial": 4.0}}
    scene["define"] = {"w": 4.0}
    scene["bodies"]["mass"]["mass"] = "=w"
    varied = read(scene)
    assert varied.variables
    with pytest.raises(ValueError, match="w must be real, not complex"):
        evaluate(varied, variables={"w": 4.0 + 1e-20j})


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copied_trajectory_has_states_between_its_steps(copied):
    motion = simulate(paper("fig6"))
    other = copied(motion)
    times = np.linspace(motion.t[0], motion.t[-1], 7)
    assert np.array_equal(other.at(times).q, motion.at(times).q)
    assert np.array_equal(other.a, motion.a)
    assert repr(other) == repr(motion)
    assert (other.q is motion.q) == (copied is copy.copy)


def test_a_pickled_trajectory_has_its_steps_alone_and_says_so():
    motion = simulate(paper("fig6"))
    other = pickle.loads(pickle.dumps(motion))
    for name in ("t", "q", "v", "a", "lam"):
        assert np.array_equal(getattr(other, name), getattr(motion, name))
    assert repr(other) == repr(motion)
    with pytest.raises(ValueError, match="states at its steps"):
        other.at(motion.t[-1])
    assert motion.at(motion.t[-1]).q.shape == (1, motion.q.shape[1])
