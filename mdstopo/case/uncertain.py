"""What is uncertain: numbers with their distributions, scenarios, and the measures that objectives become."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from mdstopo.case.arrays import FrozenDict
from mdstopo.case.measures import MEASURES, MeasureKind
from mdstopo.case.number_distributions import Distribution
from mdstopo.case.value import Value, frozen


@frozen
class UncertainNumber(Value):
    """A number of the case, by its key path as messages write it; nominal: what the case states."""

    key: str
    nominal: float
    distribution: Distribution


@frozen
class Scenario(Value):
    """Keys of the case and what they are set to in this scenario, as YAML; with its probability, all of sum 1."""

    name: str
    probability: float
    values: Mapping[str, str] = field(default_factory=FrozenDict)


@frozen
class Measure(Value):
    """What values become: name of a record of `case.measures`, with `factor` and `level` where these are part of it."""

    name: str
    factor: float = 0.0
    level: float = 1.0

    @property
    def words(self) -> str:
        """In words."""
        return self.kind.in_words.format(factor=self.factor, level=self.level)

    @property
    def kind(self) -> MeasureKind:
        """Its record."""
        return MEASURES[self.name]

    @property
    def is_sampled(self) -> bool:
        """Whether it is of the points of a sample; else of the case as it is written."""
        return bool(self.kind.made_by)


@frozen
class Uncertainty(Value):
    """The `uncertainty` section.

    sample: points for each scenario; validation: points of the fresh sample at the end, 0 for none. objectives: by
    name, of all; constraints: by place, those on responses.
    """

    numbers: tuple[UncertainNumber, ...]
    scenarios: tuple[Scenario, ...]
    sample: int
    seed: int
    validation: int
    objectives: Mapping[str, Measure]
    constraints: Mapping[int, Measure]
