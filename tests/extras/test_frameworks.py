"""Cases inside SciPy, JAX, PyTorch and OpenMDAO: values and gradients are those of `evaluate`; optimisers use them."""

import importlib
import sys

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.functions import NoValueError, Responses
from mdstopo.status import Status

CASE = """\
format: 1
gravity: [0, -9.8]
time: {end: 0.1}
bodies:
  torso: {mass: 60, inertia: 10, position: [0, 0]}
  vehicle: {mass: 2000, inertia: 6000, position: [0, -1]}
points:
  edge: {body: torso, grid: {rectangle: {center: [0, 0], size: [0.5, 0.5], count: 4}}}
  frame: {body: vehicle, grid: {line: {from: [-0.8, -1], to: [0.8, -1], count: 3}}}
members:
  belts: {from: edge, to: frame, law: {type: spring, stiffness: 20000}}
loads:
  - {body: vehicle, acceleration: [9.8, 0], angular_acceleration: 20}
objectives:
  G: {response: energy}
constraints:
  - {volume: all, equals: 1.2}
"""


@pytest.fixture(scope="module")
def case():
    return read_case(CASE)


@pytest.fixture(scope="module")
def design():
    return np.random.default_rng(4).uniform(0.05, 0.5, 12)


def test_rows_are_those_of_evaluate_and_computed_once(case, design, monkeypatch):
    calls = []
    monkeypatch.setattr("mdstopo.functions.evaluate", lambda *a, **k: calls.append(1) or mdstopo.evaluate(*a, **k))
    responses = Responses(case)
    assert responses.names == ("G", "constraints[0]")
    values, slopes = responses.at(design)
    direct = mdstopo.evaluate(case, design)
    assert values.tolist() == [direct.objectives["G"], design.sum() - 1.2]
    assert np.array_equal(slopes, [direct.gradients["G"], np.ones(12)])
    slopes[:] = 0.0  # theirs to change
    assert np.array_equal(responses.at(list(design))[1][1], np.ones(12))
    assert calls == [1]


def test_a_design_that_cannot_be_computed_says_why(case, monkeypatch):
    lost = mdstopo.evaluate(case)._replace(status=Status.STEP_TOO_SMALL, message="body x")
    monkeypatch.setattr("mdstopo.functions.evaluate", lambda *a, **k: lost)
    with pytest.raises(NoValueError, match="body x"):
        Responses(case).at(case.start)


def test_a_design_in_which_something_only_just_touches_has_values_and_derivatives_of_one_side(case, monkeypatch):
    found = mdstopo.evaluate(case)
    monkeypatch.setattr("mdstopo.functions.evaluate", lambda *a, **k: found._replace(status=Status.GRAZING))
    values, slopes = Responses(case).at(case.start)
    assert values[0] == found.objectives["G"]
    assert np.array_equal(slopes[0], found.gradients["G"])


def test_scipy_finds_the_optimum_of_run(case):
    optimize = pytest.importorskip("scipy.optimize")
    found = optimize.minimize(**Responses(case).for_scipy(), method="SLSQP", options={"maxiter": 200, "ftol": 1e-12})
    ours = mdstopo.optimize(case)
    assert abs(found.x.sum() - 1.2) < 1e-9
    assert found.fun == pytest.approx(ours.objectives["G"], rel=1e-4)
    with pytest.raises(ValueError, match="no objective 'H'; there are G"):
        Responses(case).for_scipy("H")


def test_senses_have_the_signs_that_scipy_takes():
    text = CASE.replace("response: energy", "response: energy, sense: maximize")
    text += "  - {response: energy, limit: 50}\n  - {response: energy, at_least: 1}\n"
    responses = Responses(read_case(text))
    given, x = responses.for_scipy(), responses.x0
    energy, slope = responses.at(x)[0][0], responses.at(x)[1][0]
    assert given["fun"](x) == -energy
    assert np.array_equal(given["jac"](x), -slope)
    assert [row["type"] for row in given["constraints"]] == ["eq", "ineq", "ineq"]
    assert given["constraints"][1]["fun"](x) == pytest.approx(50.0 - energy, abs=1e-12)
    assert given["constraints"][2]["fun"](x) == pytest.approx(energy - 1.0, abs=1e-12)
    assert np.array_equal(given["constraints"][1]["jac"](x), -slope)


def test_jax_takes_the_gradient_through_it(case, design):
    jax = pytest.importorskip("jax")
    import mdstopo.jax

    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    try:
        values = mdstopo.jax.function(case)
        scaled = jax.jit(jax.value_and_grad(lambda y: jax.numpy.sin(values(y**2)[0])))
        value, slope = scaled(np.sqrt(design))
        direct = mdstopo.evaluate(case, design)
        assert float(value) == pytest.approx(np.sin(direct.objectives["G"]), rel=1e-12)
        chain = np.cos(direct.objectives["G"]) * direct.gradients["G"] * 2.0 * np.sqrt(design)
        assert np.asarray(slope) == pytest.approx(chain, rel=1e-9)
        both = jax.vmap(values)(np.stack([design, 2.0 * design]))
        assert both.shape == (2, 2)
        assert float(both[0, 0]) == pytest.approx(direct.objectives["G"], rel=1e-12)
    finally:
        jax.config.update("jax_enable_x64", before)


def test_torch_takes_the_gradient_through_it(case, design):
    torch = pytest.importorskip("torch")
    import mdstopo.torch

    values = mdstopo.torch.function(case)
    x = torch.tensor(design, requires_grad=True)
    assert torch.autograd.gradcheck(lambda y: values(y)[1], (x,))
    (values(x)[0] ** 2).backward()
    direct = mdstopo.evaluate(case, design)
    assert x.grad.numpy() == pytest.approx(2.0 * direct.objectives["G"] * direct.gradients["G"], rel=1e-12)
    single = torch.tensor(design, dtype=torch.float32, requires_grad=True)
    assert values(single).dtype == torch.float32


def test_openmdao_has_the_partial_derivatives(case, design):
    om = pytest.importorskip("openmdao.api")
    from mdstopo.openmdao import CaseComponent

    problem = om.Problem(reports=False)
    problem.model.add_subsystem("system", CaseComponent(case=case), promotes=["*"])
    problem.setup()
    problem.set_val("alpha", design)
    problem.run_model()
    direct = mdstopo.evaluate(case, design)
    assert problem.get_val("G")[0] == direct.objectives["G"]
    assert problem.get_val("constraints") == pytest.approx([design.sum() - 1.2], abs=1e-12)
    totals = problem.compute_totals(of=["G", "constraints"], wrt=["alpha"])
    assert totals["G", "alpha"][0] == pytest.approx(direct.gradients["G"], rel=1e-12)
    assert np.array_equal(totals["constraints", "alpha"][0], np.ones(12))


def test_openmdao_has_variables_of_laws_as_inputs():
    om = pytest.importorskip("openmdao.api")
    from mdstopo.openmdao import CaseComponent

    text = CASE + "design: {variables: {k: {group: belts, parameter: stiffness, lower: 1000, upper: 40000}}}\n"
    case = read_case(text)
    problem = om.Problem(reports=False)
    problem.model.add_subsystem("system", CaseComponent(case=case), promotes=["*"])
    problem.setup()
    problem.run_model()
    slope = problem.compute_totals(of=["G"], wrt=["k"])["G", "k"]
    direct = mdstopo.evaluate(case)
    assert slope[0, 0] == pytest.approx(direct.variable_gradients["G"]["k"][0], rel=1e-12)


@pytest.mark.parametrize(("name", "needs"), [("jax", "jax"), ("torch", "torch"), ("openmdao", "openmdao.api")])
def test_a_framework_that_is_not_installed_is_named_with_what_installs_it(monkeypatch, name, needs):
    monkeypatch.setitem(sys.modules, needs, None)
    monkeypatch.delitem(sys.modules, f"mdstopo.{name}", raising=False)
    with pytest.raises(ModuleNotFoundError, match=rf"pip install 'mdstopo\[{name}\]'"):
        importlib.import_module(f"mdstopo.{name}")


def test_responses_say_what_they_are(case):
    assert repr(Responses(case)).endswith(f"G, constraints[0] by {len(case.start)} numbers>")
