"""Every scene of the stress test ends as it has to."""

from collections.abc import Iterator

import pytest

from mdstopo.stress.registry import scenes
from mdstopo.stress.scene import Scene
from mdstopo.stress.scene_watch import Watch


@pytest.fixture(scope="module")
def watch() -> Iterator[Watch]:
    with Watch() as found:
        yield found


@pytest.mark.parametrize("scene", [each for each in scenes().values() if not each.long], ids=lambda scene: scene.name)
def test_a_scene_ends_as_it_has_to(scene: Scene, watch: Watch) -> None:
    outcome = watch.outcome(scene)
    assert outcome.ok, f"{outcome.outcome}, error {outcome.error}, bound {scene.bound}: {outcome.message}"
