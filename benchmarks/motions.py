"""The tables of time that the applications read, from their formulas: `python -m benchmarks.motions` writes them.

Roll: a steady roll of 20 degrees and 10 s that builds up within 3 s. Swell: waves of 12 s in groups of 80 s. Passing
ship: the usual shapes, a doublet in surge and yaw and a triplet in sway, over about a minute. Amplitudes are assumed;
`docs/applications` says what they are meant to stand for.
"""

import math
from collections.abc import Callable, Iterator
from pathlib import Path

DATA = Path(__file__).resolve().parent.parent / "cases" / "data"


def build_up(t: float, duration: float) -> float:
    """0 at the start, 1 from `duration` on, with a level slope at both."""
    return 0.5 * (1.0 - math.cos(math.pi * min(t / duration, 1.0)))


def roll(t: float) -> tuple[float, ...]:
    """Roll angle in rad."""
    return (math.radians(20.0) * build_up(t, 3.0) * math.sin(2.0 * math.pi / 10.0 * t),)


def swell(t: float) -> tuple[float, ...]:
    """Surge and sway force in N, yaw moment in N m."""
    wave, group = 2.0 * math.pi / 12.0 * t, 2.0 * math.pi / 80.0 * t
    height = 0.6 + 0.4 * math.sin(group)
    r = build_up(t, 20.0)
    return (
        r * (300e3 * height * math.sin(wave) + 120e3 * math.sin(group)),
        r * (900e3 * height * math.sin(wave + 0.6) + 240e3 * math.sin(group + 0.4)),
        r * (18e6 * height * math.sin(wave + 1.9) + 3e6 * math.sin(group + 1.0)),
    )


def passing(t: float) -> tuple[float, ...]:
    """Surge and sway force in N, yaw moment in N m, of a ship that is abreast at 60 s."""
    u = (t - 60.0) / 18.0
    bell = math.exp(-u * u / 2.0)
    doublet = u * bell * math.exp(0.5)  # of height 1
    return (260e3 * doublet, 400e3 * (1.0 - 1.4 * u * u) * bell, -14e6 * doublet)


def texts() -> Iterator[tuple[str, str]]:
    """Names and contents of the files."""
    yield "tiedown-roll.csv", _text("t_s,roll_rad", roll, 0.25, 8.5, (0,), 8)
    for name, load in (("swell", swell), ("passing", passing)):
        yield f"mooring-{name}-force.csv", _text("t_s,surge_N,sway_N", load, 1.0, 100.0, (0, 1), 0)
        yield f"mooring-{name}-moment.csv", _text("t_s,yaw_Nm", load, 1.0, 100.0, (2,), 0)


def _text(
    head: str,
    load: Callable[[float], tuple[float, ...]],
    step: float,
    end: float,
    columns: tuple[int, ...],
    digits: int,
) -> str:
    lines = [head]
    for i in range(round(end / step) + 1):
        values = load(i * step)
        lines.append(",".join([f"{i * step:g}", *(f"{values[k]:.{digits}f}" for k in columns)]))
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    for name, text in texts():
        (DATA / name).write_text(text)
