"""Every family of scenes there is. A new one is a file `scenes_of_...` beside this one and a line here."""

from collections.abc import Iterable
from functools import cache
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mdstopo.stress.scene import Scene

FAMILIES: "Mapping[str, str]" = MappingProxyType(
    {
        "stiffness": "stiffness ratios up to 1e12",
        "masses": "masses from 1e-6 to 1e6 kg in one scene",
        "meeting": "attachment points that coincide, members that pass through zero length",
        "turning": "thousands of turns",
        "periods": "very many periods",
        "pulses": "pulses narrower than any step",
        "contacts": "simultaneous contacts",
        "mechanisms": "near-singular mechanisms",
        "steps": "steps far too large, tolerances at both limits",
        "designs": "alpha exactly 0, tied peaks, objectives that are zero throughout",
    }
)


@cache
def scenes_of(family: str) -> "tuple[Scene, ...]":
    """The scenes of a family, by the family's name."""
    return tuple(import_module(f"mdstopo.stress.scenes_of_{family}").scenes())


def scenes() -> "dict[str, Scene]":
    """All scenes by name, in the order of the table."""
    return {scene.name: scene for family in FAMILIES for scene in scenes_of(family)}


def chosen(words: Iterable[str], long: bool) -> "list[Scene]":
    """The scenes of these families or with names that begin so; all without words. KeyError names a wrong word."""
    wanted = tuple(words)
    found: dict[str, Scene] = {}
    for word in wanted:
        part = [each for name, each in scenes().items() if name == word or name.startswith(f"{word}-")]
        if word in FAMILIES:
            part = list(scenes_of(word))
        if not part:
            raise KeyError(word)
        found |= {each.name: each for each in part}
    if not wanted:
        found = scenes()
    return [scene for scene in found.values() if long or not scene.long or scene.name in wanted]
