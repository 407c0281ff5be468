"""The process that compiles beside this one."""

import gc

import pytest

import mdstopo
from mdstopo import warm
from mdstopo.engine import Evaluator


def test_it_ends_with_an_evaluator_that_is_never_used(monkeypatch):
    monkeypatch.setattr(warm, "is_compiled", lambda _integrator: False)
    compiler = warm.BackgroundCompiler("gauss")
    child = compiler._child
    assert child.poll() is None
    del compiler
    gc.collect()
    assert child.returncode is not None


def test_what_looks_back_at_steps_is_compiled_without_asking_which_steps_serve(monkeypatch):
    def simulate(*_arguments):
        raise AssertionError("the other process would wait for the steps to be compiled")

    monkeypatch.setattr("mdstopo.general.driver.stiffness.held_short", simulate)
    evaluator = Evaluator(mdstopo.load_case("restraint"), in_background=False)
    evaluator.compile_responses()
    with pytest.raises(AssertionError, match="would wait"):
        evaluator.driver(next(iter(evaluator.scenes)))
