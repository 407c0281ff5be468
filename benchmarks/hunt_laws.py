"""Laws of members and contacts for the hunt's second model, each with the modes that it switches between.

Written from the format's description and nothing of the package. In a mode a law is smooth and goes on beyond its end;
`margin` is positive inside it, and `after` says what follows where it is used up.
"""

from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

#: modes: of a gap, a contact or a crushed leg nothing touches, it acts, it would pull (its plateau is reached); of an
#: actuator within its limit, at the upper, at the lower one. A point is BEHIND an edge that does not hold it.
FREE, ACTS, HELD, BEHIND = range(4)


class Law:
    """Force and stored energy of one law at elongation x, rate r and time t; an inerter's force is in the mass.

    mode: as above, of a curve its piece (-1 below the first knot); growth: what is crushed for good.
    """

    def __init__(self, keys: dict[str, Any]) -> None:
        self.kind, self.keys = keys["type"], keys
        self.side = 1.0 if keys.get("side", "compression" if self.kind == "crush" else "tension") == "tension" else -1.0
        self.mode, self.growth = FREE, 0.0
        if self.kind == "curve":
            x, f = np.array(keys["curve"]).T
            self.knots, self.inside = x, PchipInterpolator(x, f)
            self.slope, self.whole = self.inside.derivative(), self.inside.antiderivative()

    @property
    def switches(self) -> bool:
        """Whether it has modes."""
        return self.kind in ("gap", "curve", "crush") or (self.kind == "actuator" and "limit" in self.keys)

    @property
    def inertance(self) -> float:
        """kg."""
        return float(self.keys["inertance"]) if self.kind == "inerter" else 0.0

    def place(self, x: float, r: float) -> None:
        """Take the mode of a state inside it, as at the start."""
        match self.kind:
            case "gap":
                self.mode = FREE if self._deep(x) < 0.0 else (HELD if self._pull(x, r) < 0.0 else ACTS)
            case "crush":
                self.mode = FREE if self._deep(x) < 0.0 else ACTS
            case "curve":
                self.mode = int(np.searchsorted(self.knots, x + 1e-9 * np.sign(r), side="right")) - 1
            case "actuator":
                demand, limit = self._demand(x, r), self.keys.get("limit", np.inf)
                self.mode = FREE if abs(demand) <= limit else (ACTS if demand > 0.0 else HELD)

    def margin(self, x: float, r: float) -> float:
        """How far the mode is from its end."""
        match self.kind:
            case "gap":
                deep = self._deep(x)
                if self.mode == FREE:
                    return -deep
                if not self.keys.get("clip", False):
                    return deep
                return min(deep, self._pull(x, r) if self.mode == ACTS else -self._pull(x, r))
            case "crush":
                deep = self._deep(x)
                if self.mode == FREE:
                    return -deep
                return self.side * r if self.mode == HELD else min(deep, self._full - deep)
            case "curve":
                i = self.mode
                below = x - self.knots[i] if i >= 0 else np.inf
                return float(min(below, self.knots[i + 1] - x if i + 1 < len(self.knots) else np.inf))
            case "actuator":
                demand, limit = self._demand(x, r), self.keys["limit"]
                sign = {FREE: -np.sign(demand), ACTS: 1.0, HELD: -1.0}[self.mode]
                return float((sign * demand + (limit if self.mode == FREE else -limit)) / limit)
        return np.inf

    def after(self, x: float, r: float) -> None:
        """Go on to the mode behind the end of this one."""
        match self.kind:
            case "gap":
                if self.mode == FREE:
                    self.mode = ACTS
                elif not self.keys.get("clip", False) or self._deep(x) <= abs(self._pull(x, r)):
                    self.mode = FREE
                else:
                    self.mode = HELD if self.mode == ACTS else ACTS
            case "crush":
                if self.mode == HELD:
                    self.growth = self.side * x - self.keys.get("gap", 0.0) - self._full
                    self.mode = ACTS
                elif self.mode == FREE:
                    self.mode = ACTS
                else:
                    self.mode = FREE if self._deep(x) < 0.5 * self._full else HELD
            case "curve":
                i = self.mode
                down = i >= 0 and (i + 1 == len(self.knots) or x - self.knots[i] < self.knots[i + 1] - x)
                self.mode += -1 if down else 1
            case "actuator":
                self.mode = FREE if self.mode != FREE else (ACTS if self._demand(x, r) > 0.0 else HELD)

    def force(self, x: float, r: float, t: float) -> float:
        """N, tension positive."""
        k = self.keys
        match self.kind:
            case "spring":
                return float(k["stiffness"] * x + k.get("damping", 0.0) * r + k.get("preload", 0.0))
            case "gap":
                push = k["stiffness"] * self._deep(x) + k.get("damping", 0.0) * self.side * r
                return float(self.side * push) if self.mode == ACTS else 0.0
            case "crush":
                if self.mode == HELD:
                    return float(self.side * k["force"])
                return float(self.side * k["stiffness"] * self._deep(x)) if self.mode == ACTS else 0.0
            case "cubic":
                return float(k["stiffness"] * x + k["cubic"] * x**3)
            case "curve":
                return self._along_curve(x)[0]
            case "pulse":
                return float(k["peak"] * np.exp(-k["rate"] * (t - k["time"]) ** 2))
            case "table":
                return float(np.interp(t, *np.array(k["table"]).T))
            case "actuator":
                held = {ACTS: 1.0, HELD: -1.0}.get(self.mode)
                return self._demand(x, r) if held is None else float(held * k["limit"])
            case "inerter":
                return 0.0
        raise KeyError(self.kind)

    def energy(self, x: float) -> float:
        """J."""
        k = self.keys
        match self.kind:
            case "spring":
                return float(0.5 * k["stiffness"] * x * x)
            case "gap":
                return float(0.5 * k["stiffness"] * self._deep(x) ** 2) if self.mode != FREE else 0.0
            case "crush":
                return float(self.force(x, 0.0, 0.0) ** 2 / (2.0 * k["stiffness"]))
            case "cubic":
                return float(0.5 * k["stiffness"] * x**2 + 0.25 * k["cubic"] * x**4)
            case "curve":
                return self._along_curve(x)[1]
        return 0.0

    @property
    def _full(self) -> float:
        """How deep a plateau begins."""
        return float(self.keys["force"] / self.keys["stiffness"])

    def _deep(self, x: float) -> float:
        return float(self.side * x - self.keys.get("gap", 0.0) - self.growth)

    def _pull(self, x: float, r: float) -> float:
        """A gap's force as a depth; negative where damping would reverse it and clip forbids that."""
        k, c = self.keys["stiffness"], self.keys.get("damping", 0.0)
        return float((k * self._deep(x) + c * self.side * r) / (k + c)) if self.keys.get("clip", False) else np.inf

    def _demand(self, x: float, r: float) -> float:
        k = self.keys
        return float(k["proportional"] * (x - k["target"]) + k["derivative"] * r)

    def _along_curve(self, x: float) -> tuple[float, float]:
        """Force and energy on the piece of the mode, as that goes on beyond its ends."""
        i, knots = self.mode, self.knots
        if 0 <= i < len(knots) - 1:
            s, cubic = x - knots[i], np.polynomial.Polynomial(self.inside.c[::-1, i])
            return float(cubic(s)), float(self.whole(knots[i]) - self.whole(0.0) + cubic.integ()(s))
        end = knots[0] if i < 0 else knots[-1]
        f, slope, s = self.inside(end), self.slope(end), x - end
        return float(f + s * slope), float(self.whole(end) - self.whole(0.0) + s * (f + 0.5 * s * slope))


class Contact:
    """A point of one body against an edge of another: the left of the way from the edge's `from` to its `to` is free.

    Depth d behind the edge, place s along it, and their rates: all as seen from the edge's body.
    """

    def __init__(self, keys: dict[str, Any], length: float) -> None:
        self.keys, self.length, self.mode = keys, length, FREE

    def push(self, depth: float, rate: float) -> float:
        """k d + c d', N."""
        return float(self.keys["stiffness"] * depth + self.keys.get("damping", 0.0) * rate)

    def place(self, s: float, depth: float, rate: float) -> None:
        """The mode at the start."""
        if depth < 0.0 or not 0.0 <= s <= self.length:
            self.mode = FREE if depth < 0.0 else BEHIND
        else:
            self.mode = ACTS if self.push(depth, rate) >= 0.0 else HELD

    def _margins(self, s: float, depth: float, rate: float) -> tuple[float, ...]:
        """Of a touch: until it opens, until its force would pull (or push again), until it slides over an end."""
        k, c = self.keys["stiffness"], self.keys.get("damping", 0.0)
        pull = (1.0 if self.mode == ACTS else -1.0) * self.push(depth, rate) / (k + c)
        # in space s is the room within all ends, and may be infinite as the length is
        return depth, pull if c > 0.0 else np.inf, s, self.length - s if np.isfinite(self.length) else np.inf

    def margin(self, s: float, depth: float, rate: float) -> float:
        """How far the mode is from its end, m."""
        if self.mode in (FREE, BEHIND):
            return depth if self.mode == BEHIND else -depth
        return min(self._margins(s, depth, rate))

    def after(self, s: float, depth: float, rate: float) -> None:
        """Go on to the mode behind the end of this one."""
        if self.mode == BEHIND:
            self.mode = FREE
        elif self.mode == FREE:
            self.mode = ACTS if 0.0 <= s <= self.length else BEHIND
        else:
            ended = int(np.argmin(self._margins(s, depth, rate)))
            self.mode = (FREE, HELD if self.mode == ACTS else ACTS, BEHIND, BEHIND)[ended]

    def force(self, depth: float, rate: float, slide: float) -> tuple[float, float]:
        """N along the edge, and along its normal on the free side."""
        if self.mode != ACTS:
            return 0.0, 0.0
        normal = self.push(depth, rate)
        drag = self.keys.get("friction", 0.0) * np.tanh(slide / self.keys.get("slip", 0.01))
        return -normal * float(drag), normal
