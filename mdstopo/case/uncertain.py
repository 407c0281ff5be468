"""What is uncertain: numbers with distributions, scenarios, and the measures that objectives become."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field
from typing import ClassVar

from mdstopo.case.arrays import FrozenDict
from mdstopo.case.measures import MEASURES, MeasureKind
from mdstopo.case.value import Value, frozen


@frozen
class Normal(Value):
    """A normal distribution; low, high: values outside are left out (truncated), None where there is no limit.

    mean, deviation: before the truncation.
    """

    type: ClassVar[str] = "normal"

    mean: float
    deviation: float
    low: float | None = None
    high: float | None = None

    def quantile(self, u: float) -> float:
        """The value that a share u, in (0, 1), of all lies below."""
        from statistics import NormalDist

        standard = NormalDist()
        least = 0.0 if self.low is None else standard.cdf((self.low - self.mean) / self.deviation)
        most = 1.0 if self.high is None else standard.cdf((self.high - self.mean) / self.deviation)
        value = self.mean + self.deviation * standard.inv_cdf(_inside(least + u * (most - least)))
        value = value if self.low is None else max(value, self.low)
        return value if self.high is None else min(value, self.high)


@frozen
class Lognormal(Value):
    """A positive number whose logarithm is normal; mean, deviation: of the number itself."""

    type: ClassVar[str] = "lognormal"

    mean: float
    deviation: float

    def quantile(self, u: float) -> float:
        """The value that a share u, in (0, 1), of all lies below."""
        from statistics import NormalDist

        square = math.log1p((self.deviation / self.mean) ** 2)
        return self.mean * math.exp(math.sqrt(square) * NormalDist().inv_cdf(u) - 0.5 * square)


@frozen
class Uniform(Value):
    """Every value between two is as likely as any other."""

    type: ClassVar[str] = "uniform"

    low: float
    high: float

    def quantile(self, u: float) -> float:
        """The value that a share u, in (0, 1), of all lies below."""
        return (1.0 - u) * self.low + u * self.high


@frozen
class Discrete(Value):
    """A few values; probabilities: of sum 1."""

    type: ClassVar[str] = "discrete"

    values: tuple[float, ...]
    probabilities: tuple[float, ...]

    def quantile(self, u: float) -> float:
        """As of `Normal`; values count in the order in which they are given."""
        below = 0.0
        for value, share in zip(self.values, self.probabilities, strict=True):
            below += share
            if u < below:
                return value
        return self.values[-1]


Distribution = Normal | Lognormal | Uniform | Discrete


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


def _inside(u: float) -> float:
    """u, kept off 0 and 1, where quantiles are infinite."""
    return min(max(u, 2.0**-60), 1.0 - 2.0**-53)
