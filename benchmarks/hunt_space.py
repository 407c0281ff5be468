"""The hunt (`hunt`) in space: bodies with full inertia, all joints, laws, surfaces, loads and responses."""

from collections.abc import Iterator

from benchmarks.hunt import Kind, hunt
from benchmarks.hunt_space_model import SpatialModel
from benchmarks.hunt_space_scenes import CHANGES, covariant, scene
from mdstopo.bench.tables import Table

SPATIAL = Kind(" in space", scene, SpatialModel, CHANGES, covariant)


def hunt_space(minutes: float = 10.0, first: int = 0) -> Iterator[Table]:
    """As `hunt`, with scenes in space."""
    return hunt(minutes, first, SPATIAL)
