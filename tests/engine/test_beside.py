"""The process that compiles beside this one."""

import gc

from mdstopo import warm


def test_it_ends_with_an_evaluator_that_is_never_used(monkeypatch):
    monkeypatch.setattr(warm, "is_compiled", lambda _integrator: False)
    beside = warm.Beside("gauss")
    child = beside._child
    assert child.poll() is None
    del beside
    gc.collect()
    assert child.returncode is not None
