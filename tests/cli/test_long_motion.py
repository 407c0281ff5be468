"""A motion that takes long says how far it is, and what makes its steps short."""

import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.cli import long_motion
from mdstopo.cli.long_motion import far_lighter, fastest, how_far, steps_done, told_while
from mdstopo.engine import Evaluator

CASE = """
format: 1
time: {end: 1}
bodies:
  speck: {mass: 1e-12, inertia: 1e-12, position: [0, 0]}
  block: {mass: 10, inertia: 1, position: [1, 0], velocity: [1, 0.1]}
members:
  tie: {from: {body: ground, at: [0, 1]}, to: {body: speck, at: [0, 0]}, law: {type: spring, stiffness: 100}}
  tail: {from: {body: speck, at: [0, 0.1]}, to: {body: block, at: [1, 0.1]}, law: {type: spring, stiffness: 1000}}
objectives: {E: {response: energy}}
"""


def test_steps_that_are_done_are_those_before_the_unused_room() -> None:
    driver: Any = SimpleNamespace(room=np.array([0.5, 0.6, 0.8, 0.0, 0.0, 7.0]), limits=[10, 4])
    assert steps_done(driver).tolist() == [0.5, 0.6, 0.8]
    driver.room[:4] = 0.0
    assert len(steps_done(driver)) == 1


def test_how_far_is_told_by_the_steps_of_late() -> None:
    before, now = np.linspace(0.0, 0.05, 51), np.linspace(0.0, 0.1, 101)
    words = how_far(before, now, 2.0, 1.1)
    assert words == "t = 0.1 of 1.1 s after 100 steps; about 1e+03 more steps of 0.001 s, which take 40 s"
    assert how_far(now, now, 2.0, 1100.1).endswith("0.001 s: more than the 1,000,000 that a motion may take")


def test_nothing_is_told_of_a_motion_that_is_at_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(long_motion, "RATE_OVER", 0.001)
    asked = list[str]()

    def all_steps(driver: Any) -> Any:
        asked.append("")
        return np.linspace(0.0, 1.0, 11)

    monkeypatch.setattr(long_motion, "steps_done", all_steps)
    case, said = read_case(CASE), list[str]()
    engine: Any = SimpleNamespace(driver=lambda name: None)
    with told_while(said.append, case, engine, case.start, "default", first=0.0, every=0.001):
        end = time.monotonic() + 20.0
        while len(asked) < 6 and time.monotonic() < end:
            time.sleep(0.002)
    assert len(asked) >= 6
    assert said == []


def test_what_makes_steps_short_is_named() -> None:
    case = read_case(CASE)
    assert far_lighter(case).startswith("speck of 1e-12 kg beside block of 10 kg")
    Evaluator(case, in_background=False).start_modes(case.start, "default")  # so that nothing is to be compiled
    words = fastest(case, case.start, "default")
    # 110 N/m at 0.1 m hold an inertia of 1e-12 kg m2, and so the mass
    assert words.endswith("is that of speck along x")


def test_a_long_motion_is_told_while_it_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(long_motion, "RATE_OVER", 0.001)
    monkeypatch.setattr(long_motion, "fastest", lambda case, alpha, name: "speck is fast")
    case, said = read_case(CASE), list[str]()
    driver: Any = SimpleNamespace(room=np.zeros(100_001), limits=[10, 100_000])
    engine: Any = SimpleNamespace(driver=lambda name: driver)
    with told_while(said.append, case, engine, case.start, "default", first=0.0, every=0.001):
        for k in range(1, 100_000):
            driver.room[k] = 1e-6 * k
            if len(said) > 1:
                break
            time.sleep(0.0005)
    assert said[0].startswith("load case default: t = ")
    assert [each.endswith("speck is fast") for each in said[:2]] == [True, False]


def test_a_short_motion_says_nothing() -> None:
    case, said = read_case(CASE), list[str]()
    engine = Evaluator(case, in_background=False)
    began = time.monotonic()
    with told_while(said.append, case, engine, case.start, "default"):
        pass
    assert said == []
    assert time.monotonic() - began < 3.0


@pytest.mark.parametrize("mass", ["1", "1e-3"])
def test_bodies_of_like_mass_are_not_blamed(mass: str) -> None:
    assert far_lighter(read_case(CASE.replace("speck: {mass: 1e-12", f"speck: {{mass: {mass}"))) == ""
