"""The tables of time that the applications read, from their formulas: `python -m benchmarks.motions` writes them.

Roll: a steady roll of 20 degrees and 10 s that builds up within 3 s. Swell: waves of 12 s in groups of 80 s. Passing
ship: the usual shapes, a doublet in surge and yaw and a triplet in sway, over about a minute. Cargo: all six motions of
a ship of 120 m in beam seas and in head seas, with the accelerations that the Code has for cargo on deck. Amplitudes
are assumed; `docs/applications` says what they are meant to stand for.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from scipy.spatial.transform import Rotation

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


@dataclass(frozen=True)
class Ship:
    """A regular motion of a ship that is set going from rest, and what pushes the cargo on its deck.

    period, set_going, end, step: in s; set_going: within which time. amplitudes: of surge, sway, heave in m, and of
    roll, pitch, yaw in rad. lean: a force in N that pushes with the motions.
    """

    period: float
    set_going: float
    end: float
    step: float
    amplitudes: tuple[float, ...]
    lean: tuple[float, float, float]

    def wave(self, t: float) -> float:
        """A sine of height 1 whose clock gathers speed."""
        b = self.set_going
        u = min(t / b, 1.0)
        clock = b * u**3 * (1.0 - 0.5 * u) + max(t - b, 0.0)  # its speed is u^2 (3 - 2 u): 1 from b on
        return math.sin(2.0 * math.pi * clock / self.period)

    def moved(self, t: float) -> tuple[float, ...]:
        """The deck where the cargo stands: its place in m from where it starts, its roll, pitch and yaw in rad."""
        surge, sway, heave, *turns = (amplitude * self.wave(t) for amplitude in self.amplitudes)
        arm = Rotation.from_euler("xyz", turns).apply(PLACE) - PLACE
        return (surge + float(arm[0]), sway + float(arm[1]), heave + float(arm[2]), *turns)

    def pushed(self, t: float) -> tuple[float, ...]:
        """Wind and spray in N, along the deck's axes, towards the lower side of the deck."""
        return tuple(force * self.wave(t) for force in self.lean)


#: the middle of the cargo's base from the point about which the ship turns, in m
PLACE = (24.0, 0.0, 6.0)
#: what is prescribed to the deck there
MOTIONS = {"x": "m", "y": "m", "z": "m", "roll": "rad", "pitch": "rad", "yaw": "rad"}
#: in beam seas and in head seas
SHIPS = {
    "rolling": Ship(
        period=13.0, set_going=1.5, end=30.0, step=0.25,
        amplitudes=(0.3, -1.0, -1.0, math.radians(27.5), math.radians(-1.5), math.radians(1.0)),
        lean=(0.0, -36.0e3, 0.0),
    ),
    "pitching": Ship(
        period=7.0, set_going=2.0, end=17.0, step=0.125,
        amplitudes=(-0.8, 0.3, 3.26, math.radians(3.0), math.radians(-8.15), math.radians(0.5)),
        lean=(-24.0e3, 0.0, 0.0),
    ),
}  # fmt: skip


def texts() -> Iterator[tuple[str, str]]:
    """Names and contents of the files."""
    yield "tiedown-roll.csv", _text("t_s,roll_rad", roll, 0.25, 8.5, (0,), 8)
    for name, load in (("swell", swell), ("passing", passing)):
        yield f"mooring-{name}-force.csv", _text("t_s,surge_N,sway_N", load, 1.0, 100.0, (0, 1), 0)
        yield f"mooring-{name}-moment.csv", _text("t_s,yaw_Nm", load, 1.0, 100.0, (2,), 0)
    for name, ship in SHIPS.items():
        for k, (motion, unit) in enumerate(MOTIONS.items()):
            yield f"cargo-{name}-{motion}.csv", _text(f"t_s,{motion}_{unit}", ship.moved, ship.step, ship.end, (k,), 8)
        yield f"cargo-{name}-wind.csv", _text("t_s,x_N,y_N,z_N", ship.pushed, ship.step, ship.end, (0, 1, 2), 0)


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
