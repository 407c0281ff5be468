"""Every scene of the stress test ends as it has to; `slow`: those that take more than a few seconds."""

from collections.abc import Iterator

import pytest

from mdstopo.stress.registry import scenes
from mdstopo.stress.scene import Scene
from mdstopo.stress.scene_watch import Watch

#: what takes more than a few seconds, once kernels are compiled
SLOW = ("periods-", "stiffness-1e12-slow-gauss", "stiffness-1e12-slow-runge-kutta", "turns-wheel-", "turns-driven-")


def _parameters() -> Iterator[object]:
    for name, scene in scenes().items():
        if scene.long:
            continue
        marks = [pytest.mark.slow] if name.startswith(SLOW) else []
        yield pytest.param(scene, id=name, marks=marks)


@pytest.fixture(scope="module")
def watch() -> Iterator[Watch]:
    with Watch() as found:
        yield found


@pytest.mark.parametrize("scene", list(_parameters()))
def test_a_scene_ends_as_it_has_to(scene: Scene, watch: Watch) -> None:
    outcome = watch.outcome(scene)
    assert outcome.ok, f"{outcome.outcome}, error {outcome.error}, bound {scene.bound}: {outcome.message}"
