"""The distributions that an uncertain number may have: one record each, which is a class.

What a record computes is the quantile function, from which samples are drawn; it needs no more than this file.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

from mdstopo.case.keys.kinds import NUMBER, POSITIVE, Kind
from mdstopo.case.keys.number_rows import Rows
from mdstopo.case.keys.records import Key, Record
from mdstopo.case.text.reading import Reading
from mdstopo.case.text.words import inside, number_text
from mdstopo.case.value import Value, frozen

#: by how much stated probabilities may miss the sum 1: thirds are written 0.333
ROUNDED = 0.01
#: the largest deviation of a lognormal number, relative to its mean; the square of more is too large for a number
WIDEST_DEVIATION = 1e100
_UNIT = "the number's unit"


class Distribution(Value):
    """What all distributions have in common.

    type: the key of the case file; doc: a few words for the case reference; keys: what is stated below that key.
    """

    type: ClassVar[str]
    doc: ClassVar[str]
    keys: ClassVar[Kind]

    @classmethod
    def made(cls, stated: Any, nominal: float, path: str, reading: Reading) -> Distribution | None:
        """The distribution from what was read; None where that makes no sense, which is noted.

        stated: what `keys` gives. nominal: the number in the case. path: of `stated` there. reading: takes mistakes.
        """
        raise NotImplementedError

    def quantile(self, u: float) -> float:
        """The value that a share u, in (0, 1), of all lies below."""
        raise NotImplementedError


@frozen
class Normal(Distribution):
    """A normal distribution; low, high: values outside are left out (truncated), None where there is no limit.

    mean, deviation: before the truncation.
    """

    type: ClassVar[str] = "normal"
    doc: ClassVar[str] = "normal, perhaps truncated"
    keys: ClassVar[Kind] = Record(
        "a normal distribution",
        (
            Key("mean", NUMBER, "mean", unit=_UNIT, otherwise="the number in the case"),
            Key("deviation", POSITIVE, "standard deviation", required=True, unit=_UNIT),
            Key("from", NUMBER, "smaller values are left out", unit=_UNIT, otherwise="no limit"),
            Key("to", NUMBER, "larger values are left out", unit=_UNIT, otherwise="no limit"),
        ),
        doc="The normal distribution; with `from` or `to` what is left of it between them.",
    )

    mean: float
    deviation: float
    low: float | None = None
    high: float | None = None

    @classmethod
    def made(cls, stated: Any, nominal: float, path: str, reading: Reading) -> Distribution | None:
        """The distribution from its keys; see `Distribution.made`."""
        mean = nominal if stated["mean"] is None else stated["mean"]
        low, high = stated["from"], stated["to"]
        if low is not None and high is not None and not _rises(low, high, path, reading):
            return None
        reach = 6.0 * stated["deviation"]
        if (low is not None and low > mean + reach) or (high is not None and high < mean - reach):
            reading.mistake(path, "hardly any probability of the distribution is between `from` and `to`")
            return None
        return cls(mean, stated["deviation"], low, high)

    def quantile(self, u: float) -> float:
        """The value that a share u of all lies below; see `Distribution.quantile`."""
        from statistics import NormalDist

        standard = NormalDist()
        least = 0.0 if self.low is None else standard.cdf((self.low - self.mean) / self.deviation)
        most = 1.0 if self.high is None else standard.cdf((self.high - self.mean) / self.deviation)
        value = self.mean + self.deviation * standard.inv_cdf(_inside(least + u * (most - least)))
        value = value if self.low is None else max(value, self.low)
        return value if self.high is None else min(value, self.high)


@frozen
class Lognormal(Distribution):
    """A positive number whose logarithm is normal; mean, deviation: of the number itself."""

    type: ClassVar[str] = "lognormal"
    doc: ClassVar[str] = "lognormal: positive, skewed"
    keys: ClassVar[Kind] = Record(
        "a lognormal distribution",
        (
            Key("mean", POSITIVE, "mean", unit=_UNIT, otherwise="the number in the case"),
            Key("deviation", POSITIVE, "standard deviation", required=True, unit=_UNIT),
        ),
        doc="A positive number whose logarithm is normal. Mean and deviation are the number's own.",
    )

    mean: float
    deviation: float

    @classmethod
    def made(cls, stated: Any, nominal: float, path: str, reading: Reading) -> Distribution | None:
        """The distribution from its keys; see `Distribution.made`."""
        mean = nominal if stated["mean"] is None else stated["mean"]
        if mean <= 0.0:
            reading.mistake(path, f"found the mean {number_text(mean)}, allowed is a number > 0")
            return None
        if not stated["deviation"] <= WIDEST_DEVIATION * mean:
            found, most = number_text(stated["deviation"]), number_text(WIDEST_DEVIATION)
            told = f"found {found}, allowed is at most {most} times the mean {number_text(mean)}"
            reading.mistake(inside(path, "deviation"), told)
            return None
        return cls(mean, stated["deviation"])

    def quantile(self, u: float) -> float:
        """The value that a share u of all lies below; see `Distribution.quantile`."""
        from statistics import NormalDist

        square = math.log1p((self.deviation / self.mean) ** 2)
        return self.mean * math.exp(math.sqrt(square) * NormalDist().inv_cdf(u) - 0.5 * square)


@frozen
class Uniform(Distribution):
    """Every value between two is as likely as any other."""

    type: ClassVar[str] = "uniform"
    doc: ClassVar[str] = "uniform between two values"
    keys: ClassVar[Kind] = Record(
        "a uniform distribution",
        (
            Key("from", NUMBER, "the least value", required=True, unit=_UNIT),
            Key("to", NUMBER, "the largest value", required=True, unit=_UNIT),
        ),
        doc="All values between two are equally likely.",
    )

    low: float
    high: float

    @classmethod
    def made(cls, stated: Any, nominal: float, path: str, reading: Reading) -> Distribution | None:
        """The distribution from its keys; see `Distribution.made`."""
        return cls(stated["from"], stated["to"]) if _rises(stated["from"], stated["to"], path, reading) else None

    def quantile(self, u: float) -> float:
        """The value that a share u of all lies below; see `Distribution.quantile`."""
        return (1.0 - u) * self.low + u * self.high


@frozen
class Discrete(Distribution):
    """A few values, each with its probability; the probabilities have the sum 1."""

    type: ClassVar[str] = "discrete"
    doc: ClassVar[str] = "a few values, each with its probability, of sum 1"
    keys: ClassVar[Kind] = Rows(("value", "probability"), "free")

    values: tuple[float, ...]
    probabilities: tuple[float, ...]

    @classmethod
    def made(cls, stated: Any, nominal: float, path: str, reading: Reading) -> Distribution | None:
        """The distribution from its table; see `Distribution.made`."""
        values, shares = stated[:, 0].tolist(), stated[:, 1].tolist()
        if min(shares) < 0.0 or abs(math.fsum(shares) - 1.0) > ROUNDED:
            total = number_text(math.fsum(shares))
            reading.mistake(path, f"found probabilities of sum {total}, allowed are such >= 0 of sum 1")
            return None
        return cls(tuple(values), scaled_to_one(shares))

    def quantile(self, u: float) -> float:
        """The value that a share u of all lies below; values count in the order in which they are given."""
        below = 0.0
        for value, share in zip(self.values, self.probabilities, strict=True):
            below += share
            if u < below:
                return value
        return self.values[-1]


#: the distributions by their key
DISTRIBUTIONS: dict[str, type[Distribution]] = {
    cls.type: cls
    for cls in (
        Normal,
        Lognormal,
        Uniform,
        Discrete,
    )
}


def scaled_to_one(shares: Sequence[float]) -> tuple[float, ...]:
    """Probabilities, scaled to the sum 1."""
    total = math.fsum(shares)
    return tuple(share / total for share in shares)


def _rises(low: float, high: float, path: str, reading: Reading) -> bool:
    """Whether `from` is below `to`; notes the mistake where it is not."""
    if low < high:
        return True
    reading.mistake(inside(path, "to"), f"found {number_text(high)}, allowed is a number above {number_text(low)}")
    return False


def _inside(u: float) -> float:
    """u, kept off 0 and 1, where quantiles are infinite."""
    return min(max(u, 2.0**-60), 1.0 - 2.0**-53)
