"""What is uncertain: numbers with their distributions, scenarios, and the measures that objectives become."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from mdstopo.case.arrays import FrozenDict
from mdstopo.case.methods.measures import MEASURES, MeasureKind
from mdstopo.case.methods.number_distributions import Distribution
from mdstopo.case.value import Value, frozen


@frozen
class UncertainNumber(Value):
    """A number of the case that varies: its key path as messages write it, and the value that the case states
    (nominal)."""

    key: str
    nominal: float
    distribution: Distribution


@frozen
class Scenario(Value):
    """Values that keys of the case have together (as YAML), with a probability; those of all scenarios have the
    sum 1."""

    name: str
    probability: float
    values: Mapping[str, str] = field(default_factory=FrozenDict)


@frozen
class Measure(Value):
    """What the values at all points of a sample become: the name of a record of `methods.measures`, with `factor` and
    `level` where these are part of it."""

    name: str
    factor: float = 0.0
    level: float = 1.0

    @property
    def words(self) -> str:
        """The measure in words, for tables."""
        return self.kind.in_words.format(factor=self.factor, level=self.level)

    @property
    def kind(self) -> MeasureKind:
        """The record of the measure (`case.methods.measures`)."""
        return MEASURES[self.name]

    @property
    def is_sampled(self) -> bool:
        """Whether it is computed from the points of a sample; else it is the value of the case as it is written."""
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
