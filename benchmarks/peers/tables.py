"""What was measured, as tables: every setting, and the fastest of each program at an error."""

from collections.abc import Sequence

from benchmarks.peers.race import Measured
from benchmarks.peers.table import OURS
from mdstopo.bench.tables import Table, significant, verdict

LEVELS = (1e-6, 1e-8, 1e-10)

_COLUMNS = (
    "program",
    "setting",
    "error of G",
    "of gradient",
    "ms",
    "quartiles",
    "of processor",
    "loading, s",
    "compiling, s",
    "MB",
)
_NOTE = (
    "Errors are relative, that of the gradient to its largest entry. Times are medians over interleaved rounds of "
    "whole calls, and what a call had of the processors; loading and compiling (all until the first result) are apart."
)


def every_setting(title: str, found: Sequence[Measured]) -> Table:
    """A row for each setting."""
    rows = [
        [
            each.entry.peer,
            each.entry.label,
            f"{each.value_error:.1e}",
            "" if each.gradient_error is None else f"{each.gradient_error:.1e}",
            significant(1e3 * each.seconds),
            " - ".join(significant(1e3 * value) for value in each.quartiles),
            significant(1e3 * each.processor_seconds),
            f"{each.loading:.1f}",
            f"{each.making:.1f}",
            f"{each.memory:.0f}",
        ]
        for each in found
    ]
    return Table(title, _COLUMNS, rows, (_NOTE,), detail=True)


def fastest(found: Sequence[Measured], level: float, peers: Sequence[str]) -> Measured | None:
    """The fastest of some programs with an error of at most a level; None where there is none."""
    good = [each for each in found if each.entry.peer in peers and each.error <= level]
    return min(good, key=lambda each: each.seconds, default=None)


def standings(
    title: str, groups: Sequence[tuple[str, Sequence[Measured]]], levels: Sequence[float], bar: float
) -> Table:
    """Ours beside the fastest peer, for each named group of measurements and each level; bar: the ratio to be met."""
    rows = []
    for name, found in groups:
        others = sorted({each.entry.peer for each in found} - {OURS})
        for level in levels:
            own, other = fastest(found, level, [OURS]), fastest(found, level, others)
            peer = ("none" if other is None else other.entry.peer), *_cells(other)
            rows.append([name, f"{level:.0e}", *_cells(own), *peer, *_ratios(own, other, bar)])
    columns = ("scene, design", "error at most", "mdstopo", "ms", "fastest peer", "setting", "ms", *_ratio_columns(bar))
    note = "The fastest setting whose measured error is at most the level. The second ratio is that of processor times."
    return Table(title, columns, rows, (note,))


def against_each(title: str, found: Sequence[Measured], bar: float) -> Table:
    """For each setting of a peer our fastest that errs no more, with error control where the peer has it."""
    rows = []
    for each in found:
        if each.entry.peer != OURS:
            alike = [
                other for other in found if "step" not in other.entry.setting or "tolerance" not in each.entry.setting
            ]
            own = fastest(alike, each.error, [OURS])
            cells = each.entry.peer, each.entry.label, f"{each.error:.1e}", significant(1e3 * each.seconds)
            error = "" if own is None else f"{own.error:.1e}"
            rows.append([*cells, *_cells(own), error, *_ratios(own, each, bar)])
    columns = ("peer", "setting", "error", "ms", "mdstopo", "ms", "error", *_ratio_columns(bar))
    note = (
        "Ours is the fastest with no larger an error, with fixed steps beside such alone. The second ratio is of "
        "processor times."
    )
    return Table(title, columns, rows, (note,))


def _ratio_columns(bar: float) -> tuple[str, str, str]:
    return "ratio", "of processor", f"at most {bar:g}"


def _ratios(own: Measured | None, other: Measured | None, bar: float) -> tuple[str, str, str]:
    if own is None or other is None:
        return "", "", ""
    ratio, busy = own.seconds / other.seconds, own.processor_seconds / other.processor_seconds
    return significant(ratio, 2), significant(busy, 2), verdict(ratio <= bar)


def _cells(each: Measured | None) -> tuple[str, str]:
    return ("none", "") if each is None else (each.entry.label, significant(1e3 * each.seconds))
