"""What is told of a motion that takes long, while it is computed: how far it is, and what makes its steps short."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import TYPE_CHECKING, Any, cast

from mdstopo.cli.output import duration, number

if TYPE_CHECKING:
    from mdstopo.case.model import Case, FloatArray
    from mdstopo.engine import Evaluator
    from mdstopo.integrators.scene_driver import SceneDriver

#: seconds until something is said, and between two lines
FIRST, EVERY = 5.0, 10.0
#: seconds by which the rate of steps is told
RATE_OVER = 0.5
#: how many times as heavy another body is from which on a light one is named
LIGHT = 1e6


@contextmanager
def told_while(
    say: Callable[[str], None], case: "Case", engine: "Evaluator", alpha: "FloatArray", name: str,
    first: float = FIRST, every: float = EVERY,
) -> Iterator[None]:  # fmt: skip
    """Meanwhile say now and then how far the motion of a load case is, from its steps so far.

    say: takes a sentence.
    case: the case.
    engine: its evaluator.
    alpha (N + P,): the design whose motion it is.
    name: of the load case.
    first, every: seconds until the first sentence, and between two.
    """
    driver, over = engine.driver(name), Event()
    end = case.load_case(name).end

    def watch() -> None:
        cause, wait = "", first
        while not over.wait(wait):
            wait = every
            before, at = steps_done(driver), time.monotonic()
            if len(before) < 2 or over.wait(RATE_OVER):
                continue
            now = steps_done(driver)
            if now[-1] >= end:
                continue  # what still takes time is not the motion
            sentence = how_far(before, now, time.monotonic() - at, end)
            if not cause:
                cause = fastest(case, alpha, name)
                sentence += f"; {cause}" if cause else ""
            say(f"load case {name}: {sentence}")

    watcher = Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()


def steps_done(driver: "SceneDriver") -> "FloatArray":
    """Times of the steps that a driver has made so far in its present run (s), the start first: room has them first,
    and behind them zeros."""
    import numpy as np

    room, most = driver.room, int(cast("Any", driver).limits[1])
    t = room[: most + 1].copy()
    return t[: int(np.argmin(np.append(np.diff(t) > 0.0, False))) + 1]


def how_far(before: "FloatArray", now: "FloatArray", seconds: float, end: float) -> str:
    """How far a motion is, and what is to come.

    before, now: times (s) of its steps at two moments, at least one step each; seconds: between them. end: of the
    motion (s).
    """
    from mdstopo.integrators.driver import MAX_STEPS

    done, recent = len(now) - 1, len(now) // 2
    step = float(now[-1] - now[-1 - recent]) / recent
    left = (end - float(now[-1])) / step
    words = f"t = {number(float(now[-1]), 4)} of {number(end)} s after {done:,} steps; about "
    words += f"{number(left, 2)} more steps of {number(step, 2)} s"
    rate = (len(now) - len(before)) / seconds
    if rate > 0.0:
        words += f", which take {duration(left / rate)}"
    return f"{words}: more than the {MAX_STEPS:,} that a motion may take" if done + left > MAX_STEPS else words


def fastest(case: "Case", alpha: "FloatArray", name: str) -> str:
    """What vibrates fastest about the start, which short steps may have to follow.

    Where kernels would have to be compiled to know, a body that is far lighter than others; empty where there is none.
    """
    from mdstopo.cli.check_scene import fastest_mover
    from mdstopo.compiler.entry import NotCompiledError, without_compiling
    from mdstopo.engine import Evaluator

    try:
        with without_compiling():
            engine = Evaluator(case, in_background=False)  # the other one is at work
            found = fastest_mover(case, engine.start_modes(alpha, name), engine.scenes[name].bodies)
    except NotCompiledError:
        return far_lighter(case)
    return f"the fastest vibration at the start, {number(found[0], 3)} rad/s, is that of {found[1]}" if found else ""


def far_lighter(case: "Case") -> str:
    """The lightest body, where it is far lighter than the heaviest; else nothing."""
    bodies = sorted(case.bodies, key=lambda body: body.mass)
    if not bodies or bodies[-1].mass < LIGHT * bodies[0].mass:
        return ""
    least, most = (f"{body.name} of {number(body.mass, 3)} kg" for body in (bodies[0], bodies[-1]))
    return f"{least} beside {most} may be what vibrates so fast"
