"""Named settings of the optimiser: the tuned default, and the methods that GSAO contains as special cases.

OC    the optimality-criteria update x = x_k (max(-f', 0)/(lambda h'))^(1/2) from the highest peak
MMA   Svanberg (1987), International Journal for Numerical Methods in Engineering 24, without later additions
CONLIN  Fleury and Braibant (1986): reciprocal where a function falls, linear where it rises
SLP   sequential linear programming in a trust box

Imports nothing heavy: the reader of case files uses it too.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from mdstopo.settings.optimizer_options import OPTIONS, Value

PRESETS: dict[str, dict[str, Value]] = {
    "default": {},
    "oc": {
        "bundle": False,
        "power": -1.0,
        "zero_shift": True,
        "sign_rule": True,
        "convex_start": 0.0,
        "peaks": 1,
        "move_limit": 0.2,
        "trust_region": False,
    },
    "mma": {
        "bundle": False,
        "power": -1.0,
        "shift_start": 1.0,
        "shift_grow": 1.0 / 0.7,
        "shift_shrink": 0.7,
        "convex_start": 0.0,
        "trust_region": False,
    },
    "conlin": {
        "bundle": False,
        "power": -1.0,
        "zero_shift": True,
        "sign_rule": True,
        "convex_start": 0.0,
        "trust_region": False,
    },
    "slp": {"bundle": False, "power": 1.0, "convex_start": 0.0},
}

#: the optimiser of cases that name none
DEFAULT_OPTIMIZER = "gsao"


@dataclass(frozen=True, slots=True)
class Settings:
    """All settings of an optimiser for one run.

    max_iterations: evaluations after the first one. tolerance: bound on the projected KKT residual relative
    to the largest |dU/dalpha|. options: every name of `OPTIONS`; build it with `resolve`. optimizer: which one, a name
    of `optimizers.OPTIMIZERS`.
    """

    max_iterations: int = 200
    tolerance: float = 1e-6
    options: Mapping[str, Value] = field(default_factory=lambda: resolve("default", {}))
    optimizer: str = DEFAULT_OPTIMIZER

    def number(self, name: str) -> float:
        """The option `name` as a float."""
        return float(self.options[name])

    def flag(self, name: str) -> bool:
        """The option `name` as a bool."""
        return bool(self.options[name])


def nearest(word: str, words: list[str]) -> str | None:
    """The one of `words` most like `word`, or None where nothing is alike."""
    from difflib import get_close_matches

    found = get_close_matches(word, words, n=1, cutoff=0.5)
    return found[0] if found else None


def mistakes(preset: str, overrides: Mapping[str, object]) -> dict[str, str]:
    """What is wrong with a preset and single settings: a sentence by name (`preset` for the preset), empty if
    nothing.

    The reader of case files places these sentences; `resolve` raises them.
    """
    found: dict[str, str] = {}
    if preset not in PRESETS:
        found["preset"] = _unknown("preset", preset, list(PRESETS))
    for name, value in overrides.items():
        sentence = _mistake(name, value)
        if sentence:
            found[name] = sentence
    return found


def resolve(preset: str, overrides: Mapping[str, object]) -> dict[str, Value]:
    """Every option's value: the defaults, under the preset, under single settings.

    Raises ValueError with one sentence a mistake: an unknown name (with the nearest right one), a wrong type,
    a value outside its limits.
    """
    wrong = mistakes(preset, overrides)
    if wrong:
        raise ValueError("; ".join(f"{name}: {sentence}" for name, sentence in wrong.items()))
    values = {name: option.default for name, option in OPTIONS.items()} | PRESETS[preset]
    for name, value in overrides.items():
        values[name] = OPTIONS[name].type(value)
    return values


def settings(
    preset: str = "default",
    overrides: Mapping[str, object] | None = None,
    *,
    max_iterations: int = 200,
    tolerance: float = 1e-6,
    optimizer: str = DEFAULT_OPTIMIZER,
) -> Settings:
    """`Settings` from a preset and single settings. Raises ValueError as `resolve` does, and for a count
    below zero."""
    if max_iterations < 0 or not tolerance >= 0.0:
        raise ValueError("max_iterations and tolerance must not be negative")
    return Settings(max_iterations, tolerance, resolve(preset, overrides or {}), optimizer)


def _mistake(name: str, value: object) -> str:
    option = OPTIONS.get(name)
    if option is None:
        return _unknown("option of the optimiser", name, list(OPTIONS))
    if option.type is bool:
        return "" if isinstance(value, bool) else f"must be true or false, not {value!r}"
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return f"must be a number, not {value!r}"
    if option.type is int and value != int(value):
        return f"must be a whole number, not {value!r}"
    low, high = option.minimum, option.maximum
    if (low is not None and not value >= low) or (high is not None and not value <= high):
        return f"must be between {low:g} and {high:g}, not {value!r}"
    return ""


def _unknown(what: str, word: str, words: list[str]) -> str:
    best = nearest(word, words)
    hint = f"did you mean {best!r}?" if best else "there are " + ", ".join(words)
    return f"unknown {what} {word!r}; {hint}"
