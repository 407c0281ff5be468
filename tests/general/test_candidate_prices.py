"""Prices of candidates that are not built, in scenes with joints, contacts, loads, any laws and responses, in space."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.scene import candidates
from mdstopo.case.scene.candidates import with_members
from mdstopo.engine import Evaluator
from mdstopo.general.model.priced_candidates import FIRST_STAGE, KIND, LAST_STAGE, MOVES, NODE, NODES, POINT
from mdstopo.sensitivity.springs_candidate_prices import COMPUTED, ERROR
from mdstopo.sensitivity.tile_interpolation import BROAD, TALL
from tests.reading import case_from
from tests.sensitivity.test_candidate_prices import assert_dense_pass_is_right
from tests.tiers import examples

#: relative to the largest
AGREE = 1e-10
SPRING = {"type": "spring", "stiffness": 900}


def looked(response, over_time):
    """An objective."""
    return {"objectives": {"G": {"response": response, "over_time": over_time}}}


def arm(law=None, **more):
    """An arm that hangs on a hinge, with a foot hinged to it that knocks at a stop; candidates from the foot to the
    ground. The ground shakes a sled, which a beam joins with the arm."""
    return {
        "gravity": [0, -9.8],
        "time": {"end": 0.3},
        "bodies": {
            "arm": {"mass": 4, "inertia": 0.4, "position": [0.5, 0]},
            "foot": {"mass": 2, "inertia": 0.1, "position": [1, -0.4], "angle": 0.2},
            "sled": {"mass": 3, "inertia": 1, "position": [2.5, 0.5]},
        },
        "joints": [
            {"type": "revolute", "bodies": ["ground", "arm"], "at": [0, 0]},
            {"type": "revolute", "bodies": ["arm", "foot"], "at": [1, 0]},
        ],
        "points": {
            "p": {"body": "foot", "grid": {"line": {"from": [0.9, -0.3], "to": [1.1, -0.6], "count": 9}}},
            "q": {"body": "ground", "grid": {"line": {"from": [0.2, -1.2], "to": [2, -1], "count": 21}}},
        },
        "members": {
            "web": {"from": "p", "to": "q", "law": law or SPRING, "candidates": "priced"},
            "tie": {
                "from": {"body": "arm", "at": [0.8, 0]}, "to": {"body": "sled", "at": [2.3, 0.4]},
                "law": {"type": "spring", "stiffness": 300, "damping": 4},
            },
        },
        "loads": [{"body": "foot", "force": ["60*sin(20*t)", 5], "at": [1, -0.5], "frame": "body"}],
        "motions": [
            {"body": "sled", "x": {"position": "2.5 + 0.1*sin(9*t)"}, "y": {"velocity": 0}, "angle": {"velocity": 0}},
        ],
        "design": {"initial": 0.4, "lower": 0},
        "objectives": {"G": {"response": {"displacement": {"body": "foot", "component": "x"}}, "over_time": "max_abs"}},
        **more,
    }  # fmt: skip


def free(law=None, **more):
    """The same without hinges and a motion of the sled, which collocation carries."""
    scene = arm(law, **more)
    return {"title": "free"} | {key: value for key, value in scene.items() if key not in ("joints", "motions")}


def in_space(law=None, **more):
    """A mast on a ball joint, pushed and turned; candidates from it to a grid on the ground."""
    return {
        "dimension": 3,
        "gravity": [0, 0, -9.8],
        "time": {"end": 0.3},
        "bodies": {
            "mast": {
                "mass": 5, "inertia": [[0.6, 0.05, 0], [0.05, 0.5, 0.02], [0, 0.02, 0.3]], "position": [0, 0, 1],
                "angular_velocity": [0, 0, 1],
            },
        },
        "joints": [{"type": "spherical", "bodies": ["ground", "mast"], "at": [0, 0, 0]}],
        "points": {
            "p": {
                "body": "mast",
                "grid": {"lattice": {"from": [0.1, 0.1, 0.6], "to": [0.2, -0.1, 1.6], "count": [1, 2, 5]}},
            },
            "q": {
                "body": "ground",
                "grid": {"plane": {"corner": [-1.2, -1, 0], "edges": [[2.4, 0, 0], [0, 2.2, 0]], "count": [5, 4]}},
            },
        },
        "members": {"web": {"from": "p", "to": "q", "law": law or SPRING, "candidates": "priced"}},
        "loads": [{"body": "mast", "force": [40, 10, 0], "at": [0.1, 0, 1.5], "frame": "body"}],
        "design": {"initial": 0.4, "lower": 0},
        "objectives": {"G": {"response": {"displacement": {"body": "mast", "component": "x"}}, "over_time": "max_abs"}},
        **more,
    }  # fmt: skip


def free_in_space(law=None, **more):
    """The same without its joint: steps of collocation where the law is smooth."""
    scene = in_space(law, title="free", **more)
    del scene["joints"]
    scene["members"]["tie"] = {
        "from": {"body": "mast", "at": [0, 0, 0]}, "to": {"body": "ground", "at": [0, 0.1, -0.5]},
        "law": {"type": "spring", "stiffness": 4000, "damping": 20},
    }  # fmt: skip
    return scene


ENERGY = looked("energy", "max")
PULL = {"member_force": {"group": "tie"}}
PUSH = {"acceleration": {"body": "foot", "at": [1, -0.5]}}
CURVE = {"type": "curve", "curve": [[-0.5, -90], [-0.1, -30], [0, 0], [0.05, 10], [0.4, 140]]}
FORMULA = {
    "type": "expression",
    "energy": "k*x^2/2 + b*x^4/4",
    "damping": "c*xd",
    "parameters": {"k": 300, "b": 2e4, "c": 3},
}
SEVERAL = [
    {"type": "gap", "stiffness": 50, "gap": -3},
    {"type": "table", "table": [[0, 0], [0.1, 25], [0.2, 0]], "active_until": 0.25},
    {**SPRING, "free_length": 0.6, "active_from": 0.11},
    {"type": "pulse", "peak": 40, "rate": 500, "time": 0.1},
]  # fmt: skip
STOP = {
    "contacts": [
        {
            "points": "p", "on": {"body": "ground", "from": [0, -0.75], "to": [2, -0.72]},
            "stiffness": 4000, "damping": 9, "friction": 0.3, "slip": 0.1,
        },
    ],
}  # fmt: skip
TWICE = {
    "loads": [],
    "load_cases": {
        "one": {"loads": [{"body": "foot", "force": [60, 0]}]},
        "two": {"loads": [{"body": "arm", "moment": "9*sin(9*t)"}], "time": {"end": 0.2}},
    },
    "objectives": {"G": {"response": PUSH, "over_time": "rms", "load_case": "one"}},
    "constraints": [
        {"response": PULL, "over_time": "max", "limit": 20, "load_case": "two"},
        {"response": {"angle": {"body": "arm"}}, "over_time": "min", "at_least": -0.01, "load_case": "one"},
        {"volume": "all", "limit": 30},
    ],
}
#: where the same motion comes out, whether members of alpha = 0 are there or not, and so the same numbers
SMOOTH = {
    "springs": arm(),
    "damped": arm({**SPRING, "damping": 7, "preload": 2}),
    "cubic": arm({"type": "cubic", "stiffness": 500, "cubic": 9000}, **looked(PUSH, "max")),
    "actuator": arm({"type": "actuator", "proportional": 80, "derivative": 4, "target": -0.05}, **looked(PULL, "max")),
    "formula": arm(FORMULA, **looked("energy", "mean")),
    "inerter": arm({"type": "inerter", "inertance": 2}, **looked(PUSH, "rms")),
    "several laws": arm(SEVERAL, **looked(PULL, "mean")),
    "energy of springs": arm({**SPRING, "free_length": 0.7}, **ENERGY),
    "with a stop": arm(**STOP),
    "two load cases": arm(**TWICE),
    "free": free(),
    "free and damped": free({**SPRING, "damping": 7, "preload": 2}, **looked("energy", "mean")),
    "in space": in_space(),
    "damped in space": in_space({**SPRING, "damping": 7, "preload": 2}, **ENERGY),
    "energy in space": in_space(**looked("energy", "mean")),
    "formula in space": in_space(FORMULA),
    "free and in space": free_in_space(),
}


#: laws that switch
SWITCHED = {
    "slack": arm({"type": "gap", "stiffness": 900, "gap": 0.02}),
    "slack and damped": arm({"type": "gap", "stiffness": 900, "gap": 0.02, "damping": 9}),
    "clipped": arm({"type": "gap", "stiffness": 900, "gap": 0.02, "damping": 30, "clip": True}, **ENERGY),
    "crushed": arm({"type": "crush", "stiffness": 9000, "force": 40}, **looked(PULL, "max")),
    "crushed later": arm({"type": "crush", "stiffness": 9000, "force": 40, "active_from": 0.1}),
    "slack, mean energy": arm({"type": "gap", "stiffness": 900, "gap": 0.02}, **looked("energy", "mean")),
    "slack, root mean square energy": arm({"type": "gap", "stiffness": 900, "gap": 0.02}, **looked("energy", "rms")),
    "kinked formula": arm({"type": "expression", "force": "k*max(x - 0.02, 0)", "parameters": {"k": 500}}),
    "slack in space": in_space({"type": "gap", "stiffness": 900, "gap": 0.01}),
    "crushed in space": in_space({"type": "crush", "stiffness": 9000, "force": 40}, **ENERGY),
}


#: fixed steps, in which no motion depends on which members of alpha = 0 there are
STEP = 0.005
#: the spatial ones, whose kernels take long to compile
IN_SPACE = [name for name in (*SMOOTH, *SWITCHED) if name.endswith("in space")]


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """Some 40 of the candidates are built."""
    monkeypatch.setattr(candidates, "START_SET", 40)


class Priced:
    """A scene with all its candidates: of which pairs they are, the design of those that are built, and what rows ask
    of any, beside the gradient of all of them at the same design."""

    def __init__(self, scene, step=STEP, **solver):
        solver |= {"step": step, **({} if "free" in scene.get("title", "") else {"integrator": "runge_kutta"})}
        self.case = case = case_from(scene, solver=solver)
        group = case.members[0]
        self.i, self.j = np.divmod(np.arange(group.candidates.count), len(group.to_local))
        whole = with_members(case, {"web": (self.i, self.j)})
        self.evaluator = Evaluator(case)
        problem = self.evaluator.problem()
        x = np.random.default_rng(5).uniform(0.1, 1.0, case.n_design)
        x[: len(group)][::2] = 0.0
        evaluation = problem.evaluation(x)
        assert evaluation.status.ok, evaluation.message
        sample = problem.sample_of(evaluation)
        factor = np.linspace(1.0, 0.5, len(sample.rows) + len(sample.constraint_rows))
        self.states = problem.pricing_states(evaluation, factor)
        at = group.from_index * len(group.to_local) + group.to_index
        self.built = np.isin(self.i * len(group.to_local) + self.j, at)
        alpha = np.zeros(whole.n_design)
        alpha[: len(self.i)][self.built] = x[: len(group)]
        alpha[len(self.i) :] = x[len(group) :]
        found = Evaluator(whole).problem().evaluate(alpha)
        rows = np.concatenate([found.gradients, found.constraint_gradients.reshape(-1, whole.n_design)])
        self.gradient = (factor @ rows)[: len(self.i)]
        self.size = np.abs(self.gradient).max()
        assert self.size > 0.0
        self.candidates = self.evaluator.candidates_of(group)

    @property
    def errors(self):
        """The differences of all prices, relative to the largest one."""
        return np.abs(self.candidates.prices(self.states, self.i, self.j) - self.gradient) / self.size

    @property
    def error(self):
        """The largest of these."""
        return self.errors.max()


@pytest.mark.parametrize("name", [name for name in SMOOTH if name not in IN_SPACE])
def test_prices_are_the_gradient_of_candidates_that_are_built(name):
    assert Priced(SMOOTH[name]).error <= AGREE


def test_prices_of_curves_come_to_the_gradient_as_steps_become_shorter():
    """At this tolerance built ones have steps end at the knots of them all."""
    long, short = (Priced(arm(CURVE, **ENERGY), step, tolerance=1e-10).error for step in (0.01, 0.0025))
    assert short <= 1e-8
    assert short <= long / 256.0


@pytest.mark.parametrize("name", [name for name in SMOOTH if name in IN_SPACE])
def test_prices_in_space_are_the_gradient_of_candidates_that_are_built(name):
    assert Priced(SMOOTH[name]).error <= AGREE


@pytest.mark.parametrize("name", [name for name in SWITCHED if name not in IN_SPACE])
def test_prices_of_laws_that_switch_come_to_the_gradient_as_steps_become_shorter(name):
    # of fifth order at least, until rounding; built, the same members have all steps end at their switches
    long, short = (Priced(SWITCHED[name], step).error for step in (0.01, 0.0025))
    assert short <= 1e-8
    assert short <= long / 256.0


@pytest.mark.parametrize("name", [name for name in SWITCHED if name in IN_SPACE])
def test_prices_in_space_of_laws_that_switch_come_to_the_gradient_as_steps_become_shorter(name):
    long, short = (Priced(SWITCHED[name], step).error for step in (0.01, 0.0025))
    assert short <= 1e-10
    assert short <= long / 256.0


def test_prices_know_members_that_begin_to_act_at_the_very_instant_of_a_peak():
    """The acceleration is largest right when crushable legs that are too long begin to pull."""
    law = {"type": "crush", "stiffness": 900, "force": 40, "side": "tension", "free_length": 0.6, "active_from": 0.1}
    scene = Priced(arm(law, **looked(PUSH, "max")))
    (states,) = scene.states.scenes
    assert 0.1 in states.when[states.steps.step[states.steps.step[:, KIND] == POINT, FIRST_STAGE]]
    assert scene.error <= 1e-8


def test_prices_know_on_which_side_of_a_members_own_jump_a_peak_is():
    """The acceleration is least right in front of the instant at which a built member's damping begins."""
    law = {
        "type": "expression", "force": "k*max(x - g, 0) + c*xd*step(x - g)", "free_length": 0.9650148616175049,
        "parameters": {"k": 500.0, "g": -0.012129066798906987, "c": 3.0},
    }  # fmt: skip
    assert Priced(arm(law, **looked(PUSH, "min")), 0.0025).error <= 1e-8


def test_prices_know_members_that_switch_in_a_step_that_another_one_has_cut_short():
    """The stages of such a step lie far behind its end."""
    assert Priced(SWITCHED["clipped"], 0.01).error <= 5e-7


def test_prices_know_that_members_with_a_plateau_at_a_hundredth_of_a_millimetre_open_once_they_are_crushed():
    """Their elastic phase is over between two nodes of a step. It begins at the plateau, to rounding."""
    law = {"type": "crush", "stiffness": 48000, "force": 1.6, "side": "compression", "gap": 0.03}
    scene = Priced(arm(law, **looked(PULL, "max")))
    assert scene.error <= 1e-7


def test_prices_of_legs_whose_ends_pass_through_each_other_come_to_a_closed_form_with_the_step(monkeypatch):
    """A body glides past with 1 m/s: its legs are pushed together to their plateau, to no length at all, and recover
    behind. No other force acts, and one at t moves the place at the end by (end - t) / mass."""
    monkeypatch.setattr(candidates, "START_SET", 1)
    stiffness, force, mass, end = 900.0, 40.0, 2.0, 0.3
    scene = {
        "time": {"end": end},
        "bodies": {"foot": {"mass": mass, "inertia": 0.1, "position": [0, 0], "velocity": [1, 0]}},
        "points": {
            "p": {"body": "foot", "grid": {"line": {"from": [0.1, 0], "to": [0.11, 0], "count": 16}}},
            "q": {"body": "ground", "grid": {"line": {"from": [0.25, 0], "to": [0.26, 0], "count": 128}}},
        },
        "members": {
            "web": {
                "from": "p", "to": "q", "candidates": "priced",
                "law": {"type": "crush", "stiffness": stiffness, "force": force, "side": "compression"},
            },
        },
        "design": {"initial": 0, "lower": 0},
        "objectives": {"G": {"response": {"displacement": {"body": "foot", "component": "x"}}, "over_time": "final"}},
    }  # fmt: skip
    i, j = np.divmod(np.arange(16 * 128), 128)
    meet = np.linspace(0.25, 0.26, 128)[j] - np.linspace(0.1, 0.11, 16)[i]
    full = force / stiffness

    def moved(begin, stop, level, slope):
        """By a force level + slope t from begin to stop."""
        at = [end * level * t + (end * slope - level) * t**2 / 2 - slope * t**3 / 3 for t in (begin, stop)]
        return (at[1] - at[0]) / mass

    exact = moved(0.0, full, 0.0, -stiffness) + moved(full, meet, -force, 0.0)
    exact += moved(meet, meet + full, force + stiffness * meet, -stiffness)

    def off(step):
        """How far prices and the gradient of some of the members are from it, relative to the largest."""
        solver = {"step": step, "integrator": "runge_kutta"}
        case = case_from(scene, solver=solver)
        evaluator = Evaluator(case)
        problem = evaluator.problem()
        evaluation = problem.evaluation(np.zeros(case.n_design))
        (sign,) = np.sign(problem.sample_of(evaluation).rows)
        prices = evaluator.candidates_of(case.members[0]).prices(problem.pricing_states(evaluation, [1.0]), i, j)
        some = slice(None, None, 16)
        whole = with_members(case, {"web": (i[some], j[some])})
        (gradient,) = Evaluator(whole).problem().evaluate(np.zeros(whole.n_design)).gradients
        errors = np.abs(sign * prices - exact).max(), np.abs(sign * gradient - exact[some]).max()
        return np.array(errors) / np.abs(exact).max()

    assert (off(0.01) <= [5e-2, 6e-3]).all()
    assert (off(0.00125) <= [7e-3, 7e-4]).all()
    assert (off(0.0003125) <= [2e-3, 3e-4]).all()


def test_virtual_changes_within_a_step_add_up_to_what_its_stages_give_however_short_it_is():
    """Crushable legs with ends within 1e-7 m of each other switch one right behind the other."""
    law = {"type": "crush", "stiffness": 3600, "force": 21, "side": "compression"}
    _, states = states_of(dense(arm(law, **ENERGY), 1e-7), 0.36)
    (scene,) = states.scenes
    steps = scene.steps
    sums = np.array(
        [scene.change[first:last, 0].sum(axis=0) for first, last in steps.step[:, [FIRST_STAGE, LAST_STAGE]]]
    )
    density = steps.change[:, 0].reshape(len(sums), NODES, -1)
    counts = (steps.step[:, KIND] != POINT) & (steps.step[:, MOVES] != 0)
    assert steps.step_time[counts, 1].min() < 1e-9
    # integrals of the polynomials through all nodes
    weights = np.linalg.solve(np.vander(NODE, increasing=True).T, 1.0 / np.arange(1, NODES + 1))
    size = np.abs(sums[counts]).max(axis=1)
    assert (np.abs(np.tensordot(density, weights, axes=(1, 0)) - sums)[counts].max(axis=1) <= 1e-12 * size).all()
    assert (np.abs(density[counts]).max(axis=(1, 2)) <= 10.0 * size).all()


def test_time_goes_on_where_a_member_switches_right_behind_another():
    """The response was not a number in the step without length that ended at the second switch."""
    law = {"type": "crush", "stiffness": 900, "force": 40, "side": "tension", "free_length": 0.3, "active_from": 0.1}
    solver = {"step": STEP, "integrator": "runge_kutta"}
    case = case_from(arm(law, **looked(PUSH, "max")), solver=solver)
    whole = with_members(case, {"web": np.divmod(np.arange(80), 21)})
    alpha = np.full(whole.n_design, 0.4)
    motion = mdstopo.simulate(whole, alpha)
    assert np.diff(motion.t).min() > 0.0
    at = np.array([0.0, -0.1])  # of the point, from the middle of the foot, as drawn
    turn = motion.q[:, 5] - 0.2
    c, s, w, b = np.cos(turn), np.sin(turn), motion.v[:, 5], motion.a[:, 5]
    arm_x, arm_y = c * at[0] - s * at[1], s * at[0] + c * at[1]
    size = np.hypot(motion.a[:, 3] - b * arm_y - w**2 * arm_x, motion.a[:, 4] + b * arm_x - w**2 * arm_y)
    found = mdstopo.evaluate(whole, alpha, gradient=False).objectives["G"]
    assert found >= size.max() * (1.0 - 1e-9)
    assert found <= 1.5 * size.max()


def test_the_price_of_mirror_images_is_the_sum_of_theirs():
    """Two groups with one alpha for a member and its image: the gradient by that alpha."""
    scene = arm(law={**SPRING, "damping": 7})
    scene["points"] |= {
        "p2": {"body": "foot", "grid": {"line": {"from": [0.8, -0.3], "to": [1.0, -0.6], "count": 9}}},
        "q2": {"body": "ground", "grid": {"line": {"from": [2, -1.1], "to": [0.2, -1], "count": 21}}},
    }
    scene["members"]["image"] = {**scene["members"]["web"], "from": "p2", "to": "q2", "cost": 1}
    scene["members"]["web"]["cost"] = 1
    scene["design"]["mirrored"] = [["web", "image"]]
    scene["constraints"] = [{"volume": "all", "limit": 30}]
    solver = {"step": STEP, "integrator": "runge_kutta"}
    case = case_from(scene, solver=solver)
    web, image = case.members[0], case.members[-1]
    assert np.array_equal(web.from_index, image.from_index)
    width = len(web.to_local)
    i, j = np.divmod(np.arange(web.candidates.count), width)
    whole = with_members(case, {"web": (i, j), "image": (i, j)})
    evaluator = Evaluator(case)
    problem = evaluator.problem()
    x = np.random.default_rng(5).uniform(0.1, 1.0, case.space.size)
    evaluation = problem.evaluation(x)
    states = problem.pricing_states(evaluation, np.ones(len(problem.sample_of(evaluation).rows)))
    built = web.from_index * width + web.to_index
    alpha = np.zeros(whole.space.size)
    alpha[whole.space.slots[whole.group_slices["web"]][built]] = x[case.space.slots[case.group_slices["web"]]]
    tie = case.group_slices["tie"]
    alpha[whole.space.slots[whole.group_slices["tie"]]] = x[case.space.slots[tie]]
    gradient = Evaluator(whole).problem().evaluate(alpha).gradients.sum(axis=0)[: len(i)]
    found = evaluator.candidates_of(web).prices(states, i, j)
    assert np.abs(found - gradient).max() <= AGREE * np.abs(gradient).max()
    alone = case_from(scene, solver=solver, design={"lower": 0, "initial": 0.4})
    apart = Evaluator(alone).candidates_of(alone.members[0]).prices(states, i, j)
    assert np.abs(apart - gradient).max() > 0.01 * np.abs(gradient).max()


def test_a_pass_finds_the_best_candidates_and_what_all_gain():
    scene = Priced(arm(SEVERAL, **looked(PULL, "mean")))
    gradient, size = scene.gradient, scene.size
    worth = 0.1 * size
    gain = np.where(scene.built, -np.inf, -(gradient + worth))
    found = scene.candidates.go_through(scene.states, worth, 10**6)
    assert found.seen == (~scene.built).sum()
    assert abs(found.best - max(gain.max(), 0.0)) <= AGREE * size
    assert abs(found.together - np.maximum(gain, 0.0).sum()) <= 1e-9 * len(gain) * size
    assert abs(found.ratio - np.maximum(gain, 0.0).max()) <= AGREE * size
    told = sorted(zip(found.i.tolist(), found.j.tolist(), strict=True))
    assert told == sorted(zip(scene.i[~scene.built].tolist(), scene.j[~scene.built].tolist(), strict=True))
    wanted = gain.reshape(9, 21)[found.i, found.j]
    assert np.abs(found.gain - wanted).max() <= AGREE * size


@pytest.mark.parametrize(
    "law",
    [{**SPRING, "damping": 7, "preload": 2}, {"type": "cubic", "stiffness": 500, "cubic": 9000}],
    ids=["springs", "cubic"],
)
def test_a_dense_pass_computes_few_of_the_prices_and_knows_all(law):
    scene = arm(law)
    # every point of the foot with every point of a piece of ground: the ground's points are the rows of tiles
    scene["points"]["p"]["grid"] = {"line": {"from": [0.9, -0.3], "to": [0.91, -0.31], "count": BROAD}}
    scene["points"]["q"]["grid"] = {"line": {"from": [1.2, -1.1], "to": [1.21, -1.1], "count": 2 * TALL}}
    candidates, states = states_of(scene, 0.2)
    sample = candidates.prices(states, *np.divmod(np.arange(BROAD * 2 * TALL), 2 * TALL))
    assert_dense_pass_is_right(candidates, states, np.abs(sample).max(), 1e-12)


#: laws with modes, some of which members of a dense tile go through in a step, and others do not
DENSE = {
    "slack": {"type": "gap", "stiffness": 900, "gap": 0.005, "side": "compression"},
    "damped and clipped": {
        "type": "gap",
        "stiffness": 900,
        "gap": 0.005,
        "side": "compression",
        "damping": 30,
        "clip": True,
    },
    "crushed": {"type": "crush", "stiffness": 9000, "force": 20},
    "curve": CURVE,
    "steered": {"type": "actuator", "proportional": 80, "derivative": 4, "target": -0.05, "limit": 6},
    "formula": {"type": "expression", "force": "-900*max(-x - 0.005, 0) + 3*xd"},
    "several": [*SEVERAL, {"type": "gap", "stiffness": 300, "gap": 0.005, "side": "compression", "free_length": 0.8}],
}


def dense(scene, width=0.002):
    """The points of both grids lie as near each other as in a tile of 1e8 candidates."""
    for name, count, begin, end in (
        ("p", BROAD, [0.9, -0.3], [0.9 + width, -0.3 - width]),
        ("q", 2 * TALL, [1.2, -1.1], [1.2 + width, -1.1]),
    ):
        line = {"from": begin, "to": end, "count": count}
        if scene.get("dimension") == 3:
            at = {"p": [0.1, 0.1, 0.9], "q": [0.6, -0.4, 0]}[name]
            line = {
                "from": at,
                "to": np.add(at, [width, 0.5 * width, width * (name == "p")]).tolist(),
                "count": count,
            }
        scene["points"][name]["grid"] = {"line": line}
    return scene


def assert_dense(scene, width=0.002, alpha=0.2):
    """A pass over a dense scene knows all prices, and computes few."""
    candidates, states = states_of(dense(scene, width), alpha)
    rows, columns = len(candidates.homes[0]), len(candidates.homes[1])
    sample = candidates.prices_between(states, *np.divmod(np.arange(0, rows * columns, 7), columns))
    assert_dense_pass_is_right(candidates, states, np.abs(sample).max(), 1e-12)


@pytest.mark.parametrize("name", DENSE)
def test_a_dense_pass_by_laws_with_modes_computes_few_of_the_prices_and_knows_all(name):
    assert_dense(arm(DENSE[name], **ENERGY) if name == "crushed" else arm(DENSE[name]))


def test_a_dense_pass_by_laws_with_modes_knows_all_load_cases():
    assert_dense(arm(DENSE["slack"], **TWICE))


def test_a_dense_pass_computes_few_where_some_members_are_crushed_from_the_start_and_knows_all():
    """The foot swings towards the floor: members that are too short by the plateau or more are crushed at once, those
    beside them are still elastic, and others do not act."""
    begin, end = np.array([0.905, -0.305]), np.array([1.205, -1.1])
    law = DENSE["crushed"]
    free = np.linalg.norm(end - begin) - law["force"] / law["stiffness"]
    scene = dense(arm({**law, "free_length": free}), 0.01)
    # about its hinge, 0.4 m above it
    scene["bodies"]["foot"] |= {"angular_velocity": 2, "velocity": [0.8, 0]}
    candidates, states = states_of(scene, 0.0)
    common = candidates.common(states, 0.0)
    every = np.arange(candidates.shape[0] * candidates.shape[1])
    tiles, found = candidates.tiles(states, common, every, True)
    assert tiles[:, COMPUTED].max() < 0.12 * TALL * BROAD
    assert common[ERROR] > 0.0
    common[ERROR] = 0.0
    _, exact = candidates.tiles(states, common, every, True)
    there = np.isfinite(exact)
    assert np.abs(found[there] - exact[there]).max() <= 1e-11 * np.abs(exact[there]).max()


@pytest.mark.parametrize("name", ["slack", "curve"])
def test_a_dense_pass_in_space_by_laws_with_modes_computes_few_of_the_prices(name):
    assert_dense(in_space(DENSE[name], **ENERGY), 0.0005)


def test_a_dense_pass_by_laws_with_modes_knows_mirror_images():
    scene = dense(arm(DENSE["slack"]))
    for name in ("p", "q"):
        ends = {end: np.array(scene["points"][name]["grid"]["line"][end]) for end in ("from", "to")}
        line = {end: (at - [0.05, 0.02]).tolist() for end, at in ends.items()} | {
            "count": {"p": BROAD, "q": 2 * TALL}[name]
        }
        scene["points"][f"{name}2"] = {"body": scene["points"][name]["body"], "grid": {"line": line}}
    scene["members"]["web"]["cost"] = 1
    scene["members"]["image"] = {**scene["members"]["web"], "from": "p2", "to": "q2"}
    scene["design"]["mirrored"] = [["web", "image"]]
    candidates, states = images_of(scene, 0.2)
    sample = candidates.prices(states, *np.divmod(np.arange(0, BROAD * 2 * TALL, 7), 2 * TALL))
    assert_dense_pass_is_right(candidates, states, np.abs(sample).max(), 1e-12)


def images_of(scene, alpha):
    """What `states_of` tells of a scene with mirrored groups."""
    case = case_from(scene, solver={"step": STEP, "integrator": "runge_kutta"})
    evaluator = Evaluator(case)
    problem = evaluator.problem()
    evaluation = problem.evaluation(np.full(case.space.size, alpha))
    states = problem.pricing_states(evaluation, np.ones(len(problem.sample_of(evaluation).rows)))
    return evaluator.candidates_of(case.members[0]), states


def random_law(rng, kind):
    """A law with modes, with random numbers."""
    side = {"side": str(rng.choice(["tension", "compression"]))}
    later = {"active_from": float(rng.uniform(0.02, 0.2))} if rng.random() < 0.3 else {}
    if kind == "gap":
        damped = {"damping": float(rng.uniform(1, 20)), "clip": bool(rng.random() < 0.5)} if rng.random() < 0.5 else {}
        own = {"stiffness": float(rng.uniform(100, 2000)), "gap": float(rng.uniform(-0.05, 0.1)), **side, **damped}
    elif kind == "crush":
        own = {"stiffness": float(rng.uniform(1e3, 9e3)), "force": float(rng.uniform(3, 60)), **side}
    elif kind == "curve":
        knots = np.sort(rng.uniform(-0.3, 0.4, int(rng.integers(3, 7))))
        own = {"curve": np.stack([knots, np.sort(rng.uniform(-90, 140, len(knots)))], axis=1).tolist()}
    elif kind == "actuator":
        own = {"proportional": float(rng.uniform(20, 300)), "derivative": 3.0, "target": -0.05, "limit": 7.0}
    else:
        numbers = {"k": 500.0, "g": float(rng.uniform(-0.02, 0.1)), "c": 3.0}
        own = {"force": "k*max(x - g, 0) + c*xd*step(x - g)", "parameters": numbers}
    return {"type": kind, **own, **later}


def assert_pass_is_right(candidates, states):
    """A pass knows what each of its candidates is worth."""
    common = candidates.common(states, 0.0)
    every = np.arange(candidates.shape[0] * candidates.shape[1])
    _, found = candidates.tiles(states, common, every, True)
    error, common[ERROR] = common[ERROR], 0.0
    _, exact = candidates.tiles(states, common, every, True)
    there = np.isfinite(exact)
    assert np.array_equal(there, np.isfinite(found))
    # where nothing is worth anything, prices are rounding
    assert np.abs(found[there] - exact[there]).max() <= 5.0 * max(error, 1e-12 * np.abs(exact[there]).max(), 1e-20)


@pytest.mark.parametrize("seed", range(examples(1, 16)))
@pytest.mark.parametrize("kind", ["gap", "crush", "curve", "actuator", "expression"])
def test_passes_over_random_tiles_know_what_each_of_their_candidates_is_worth(kind, seed):
    rng = np.random.default_rng([seed, *kind.encode()])
    looks = [ENERGY, looked("energy", "mean"), looked(PULL, "max"), looked(PUSH, "rms"), STOP, {}]
    scene = dense(arm(random_law(rng, kind), **looks[rng.integers(len(looks))]), 10.0 ** rng.uniform(-2.5, -0.5))
    assert_pass_is_right(*states_of(scene, 0.2))


def test_a_member_that_is_crushed_stays_elastic_where_a_node_lies_right_behind_the_end_of_crushing():
    """Its elongation is at the plateau there, to rounding, and it is not crushed again. Prices of members side by side
    are smooth in where their ends are."""
    law = {
        "type": "crush", "stiffness": 3883.8691187044637, "force": 31.5617416794616, "side": "compression",
        "gap": 0.0060288445393175075, "free_length": 0.8039556220960358,
    }  # fmt: skip
    scene = arm(law, **looked(PUSH, "rms"))
    turn = 0.002481637740336769
    arc = {"center": [0.6000000000000001, -0.3], "radius": 0.3, "from": -turn, "to": turn, "count": 200}
    line = {"from": [1.2, -1.1], "to": [1.2006541199315484, -1.0985939476393867], "count": 31}
    scene["points"]["p"]["grid"], scene["points"]["q"]["grid"] = {"arc": arc}, {"line": line}
    candidates, states = states_of(scene, 0.0)
    assert_pass_is_right(candidates, states)
    columns = np.arange(138, 159)
    prices = candidates.prices_between(states, np.full(len(columns), 28), columns)
    smooth = np.polynomial.Chebyshev.fit(columns, prices, 8)
    assert np.abs(smooth(columns) - prices).max() <= 1e-12 * np.abs(prices).max()


def test_a_pass_knows_members_that_are_crushed_in_steps_so_short_that_rounding_decides():
    """Members that are built switch one 1e-8 s behind the other."""
    law = {"type": "crush", "stiffness": 3600, "force": 21, "side": "compression", "gap": 0.049, "active_from": 0.0385}
    scene = free(law)
    scene["members"]["web"] |= {"from": "q", "to": "p"}
    scene["points"]["p"]["grid"] = {"rectangle": {"center": [0.9, -0.3], "size": [1.25, 0.87], "count": 4}}
    scene["points"]["q"]["grid"] = {"lattice": {"from": [1.2, -1.1], "to": [1.5, -1.08], "count": [8, 8]}}
    assert_pass_is_right(*states_of(scene, 0.36, step=0.01, integrator="runge_kutta"))


def test_a_dense_pass_in_space_by_legs_that_are_crushed_knows_all_prices():
    assert_pass_is_right(*states_of(dense(in_space(DENSE["crushed"], **ENERGY)), 0.2))


def test_a_pass_computes_few_of_the_members_that_are_crushed_by_different_lengths(monkeypatch):
    """Within a tile members are crushed by millimetres more or less, and begin and end to be so in different steps. As
    many are built as in the first round of a run, which hold the arm."""
    monkeypatch.undo()
    law = {**DENSE["crushed"], "side": "compression"}
    candidates, states = states_of(dense(arm(law, **looked(PUSH, "rms")), 0.05), 0.2)
    assert_pass_is_right(candidates, states)
    every = np.arange(candidates.shape[0] * candidates.shape[1])
    tiles, _ = candidates.tiles(states, candidates.common(states, 0.0), every)
    assert tiles[:, COMPUTED].max() < 0.12 * TALL * BROAD


@pytest.mark.parametrize("name", ["slack", "damped and clipped", "steered", "crushed"])
def test_a_pass_knows_members_about_the_corners_of_a_grid_in_space(name):
    """Columns of a tile are pieces of several lines of the grid, of which hardly two members do the same in a step."""
    scene = dense(in_space(DENSE[name], **ENERGY), 0.05)
    plane = {"corner": [0.4, -0.6, 0], "edges": [[0.5, 0, 0.05], [0, 0.4, 0]], "count": [5, 50]}
    scene["points"]["q"]["grid"] = {"plane": plane}
    candidates, states = states_of(scene, 0.2)
    assert_pass_is_right(candidates, states)


def test_prices_of_members_in_one_mode_do_not_lose_digits_to_members_beside_them_in_another():
    """Of members that are crushed within 0.2 mm, some begin to act beside others that are a metre longer or shorter."""
    scene = arm({"type": "crush", "stiffness": 1e7, "force": 2000.0, "free_length": 1.0}, **looked("energy", "mean"))
    for name, count, begin, end in (("p", TALL, [0.9, -0.3], [0.901, -0.301]), ("q", BROAD, [-100, -1.1], [100, -1.1])):
        scene["points"][name]["grid"] = {"line": {"from": begin, "to": end, "count": count}}
    assert_pass_is_right(*states_of(scene, 0.0))


def test_formulas_that_may_be_sharp_anywhere_are_priced_one_by_one():
    scene = dense(arm({"type": "expression", "force": "90*tanh(x/0.001)"}))
    candidates, states = states_of(scene, 0.2)
    assert candidates.common(states, 0.0)[ERROR] == 0.0
    smooth, states = states_of(dense(arm(FORMULA)), 0.2)
    assert smooth.common(states, 0.0)[ERROR] > 0.0


def states_of(scene, alpha, **solver):
    """The candidates of a scene's first group, and what the rows ask of them where all members have that alpha."""
    solver = solver or {"step": STEP, "integrator": "runge_kutta"}
    case = case_from(scene, solver=solver)
    evaluator = Evaluator(case)
    problem = evaluator.problem()
    evaluation = problem.evaluation(np.broadcast_to(alpha, case.n_design).astype(float))
    states = problem.pricing_states(evaluation, np.ones(len(problem.sample_of(evaluation).rows)))
    return evaluator.candidates_of(case.members[0]), states


#: what a body on a rail of 1 kg and 600 N/m is lifted by a force of 2 N (m), and a bit less
LIFT = 2 * 2 / 600
NEARLY = 0.9 * LIFT


@pytest.mark.parametrize(
    "law",
    [
        {"type": "gap", "stiffness": 900, "gap": NEARLY},
        {"type": "curve", "curve": [[-1, 0], [0, 0], [NEARLY, 0], [1.05 * NEARLY, 30], [1, 20000]]},
        {"type": "expression", "force": f"900*max(x - {NEARLY}, 0)"},
    ],
    ids=["gap", "curve", "formula"],
)
def test_few_candidates_that_act_amid_many_that_do_not_are_found(law):
    """The body is lifted off a long row of points: only members to those right below become long enough to act."""
    scene = {
        "time": {"end": 0.3},
        "bodies": {
            "lift": {"mass": 1, "inertia": 0.1, "position": [0, 0.5]},
            "deck": {"mass": 1e4, "inertia": 1e4, "position": [0, -1]},
        },
        "joints": [{"type": "prismatic", "bodies": ["ground", "lift"], "at": [0, 0.5], "axis": [0, 1]}],
        "points": {
            "p": {"body": "lift", "grid": {"line": {"from": [1e-3, 0.05], "to": [1.1e-3, 0.05], "count": TALL}}},
            "q": {"body": "deck", "grid": {"line": {"from": [-1, 0], "to": [1, 0], "count": BROAD}}},
        },
        "members": {
            "web": {"from": "p", "to": "q", "law": law, "candidates": "priced"},
            "tie": {
                "from": {"body": "ground", "at": [0, -1]}, "to": {"body": "lift", "at": [0, 0.4]},
                "law": {"type": "spring", "stiffness": 600},
            },
        },
        "loads": [{"body": "lift", "force": [0, 2]}],
        "design": {"initial": 0.4, "lower": 0},
        **looked({"displacement": {"body": "lift", "component": "y"}}, "max_abs"),
        "constraints": [{"volume": "all", "limit": 20}],
    }  # fmt: skip
    group = case_from(scene).members[0]
    candidates, states = states_of(
        scene, np.append(np.zeros(len(group)), 1.0), integrator="runge_kutta", tolerance=1e-8
    )
    i, j = np.divmod(np.arange(TALL * BROAD), BROAD)
    prices = candidates.prices(states, i, j)
    assert 0 < (prices != 0.0).sum() < 0.05 * len(prices)
    there = np.isin(i * BROAD + j, group.from_index * BROAD + group.to_index)
    best = -prices[~there].min()
    assert best > 0.0
    assert abs(candidates.go_through(states, 0.0, 10).best - best) <= 1e-12 * best


def test_a_dense_pass_knows_the_points_of_mirror_images():
    """The images of evenly spread points are so, too, but for one."""
    scene = arm({**SPRING, "damping": 7})
    evenly = np.linspace([0.9, -0.3], [0.91, -0.31], BROAD)
    elsewhere = evenly - [0.05, 0.02]
    elsewhere[57] += [0.02, -0.1]
    ground = {"grid": {"line": {"from": [1.2, -1.1], "to": [1.204, -1.1], "count": 2 * TALL}}}
    scene["points"] = {
        "p": {"body": "foot", "grid": {"list": evenly.tolist()}}, "q": {"body": "ground", **ground},
        "p2": {"body": "foot", "grid": {"list": elsewhere.tolist()}}, "q2": {"body": "ground", **ground},
    }  # fmt: skip
    scene["members"]["web"]["cost"] = 1
    scene["members"]["image"] = {**scene["members"]["web"], "from": "p2", "to": "q2"}
    scene["design"]["mirrored"] = [["web", "image"]]
    candidates, states = images_of(scene, 0.2)
    sample = candidates.prices(states, *np.divmod(np.arange(BROAD * 2 * TALL), 2 * TALL))
    assert_dense_pass_is_right(candidates, states, np.abs(sample).max(), 1e-12)


def test_a_pass_over_a_part_of_the_candidates_prices_them_as_the_whole_pass_does():
    scene = Priced(SWITCHED["clipped"])
    part = scene.evaluator.candidates_of(scene.case.members[0], 60).go_through(scene.states, 0.0, 10**6)
    whole = scene.candidates.go_through(scene.states, 0.0, 10**6)
    assert 30 < part.seen < 100 < whole.seen
    prices = np.full((9, 21), np.nan)
    prices[whole.i, whole.j] = whole.gain
    assert np.array_equal(prices[part.i, part.j], part.gain)


def test_a_pass_does_not_depend_on_threads(monkeypatch):
    scene = Priced(SWITCHED["slack"])
    found = []
    for threads in ("1", "3"):
        monkeypatch.setenv("MDSTOPO_THREADS", threads)
        found.append(scene.candidates.go_through(scene.states, 0.1 * scene.size, 100))
    one, other = found
    assert (one.seen, one.best, one.together, one.ratio) == (other.seen, other.best, other.together, other.ratio)
    assert np.array_equal(one.i, other.i)
    assert np.array_equal(one.j, other.j)
