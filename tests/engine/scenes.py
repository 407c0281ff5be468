"""Scenes as case text: random ones with chosen features, and the paper's. JSON is YAML, so a dictionary is enough."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from mdstopo.case.model import Case
from mdstopo.case.reader import load_case
from tests.reading import case_from

CASES = Path(__file__).parents[2] / "cases"

#: what a random scene can have beside bodies, springs, constant loads and gravity
FEATURES = frozenset({
    "ground", "damping", "preload", "free_length", "off_centre", "follower", "kinks", "jumps", "spin", "reversed",
    "several", "fixed", "power",
})  # fmt: skip


def read(scene: dict[str, Any], **solver: Any) -> Case:
    """The case of a scene, with solver settings."""
    return case_from(scene, solver=solver)


def with_solver(case: Case, **solver: Any) -> Case:
    """The same case with other solver settings."""
    return replace(case, solver=replace(case.solver, **solver))


@cache
def paper(name: str, *overrides: tuple[str, Any]) -> Case:
    """A case of the paper's, from the cases folder."""
    return load_case(CASES / f"{name}.yaml", overrides=dict(overrides))


INTERIOR = (("loads", "[{body: vehicle, acceleration: [20, 0]}]"), ("time.end", 0.4))


def interior(**solver: Any) -> Case:
    """The paper's scene loaded in translation until 0.4 s, where the highest peak is inside the time."""
    return with_solver(paper("fig6", *INTERIOR), **solver)


def random_scene(seed: int, *features: str, bodies: int = 2, over_time: str = "max") -> dict[str, Any]:
    """A scene whose slowest and fastest pairs swing between about a half and four times.

    Bodies stand 1.5 m apart, their points within 0.35 m of the centres, so that no member is near zero length at the
    start.
    """
    unknown = set(features) - FEATURES
    if unknown:
        raise ValueError(f"no such features: {unknown}")
    rng = np.random.default_rng(seed)
    end = float(rng.uniform(0.3, 0.8))
    names = [f"b{i}" for i in range(bodies)]
    centre = np.array([[1.5 * i, 0.3 * (-1) ** i] for i in range(bodies)]) + rng.uniform(-0.1, 0.1, (bodies, 2))
    mass = np.exp(rng.uniform(0.0, 4.0, bodies))
    scene: dict[str, Any] = {
        "gravity": [float(rng.uniform(-2, 2)), -9.8],
        "time": {"start": 0.05, "end": 0.05 + end},
        "bodies": {},
        "points": {},
        "members": {},
        "loads": [],
        "design": {"initial": 0.5},
        "objectives": {"G": {"response": "energy", "over_time": over_time}},
    }
    for name, x, m in zip(names, centre, mass, strict=True):
        body = {
            "mass": float(m), "inertia": float(m * rng.uniform(0.05, 0.2)), "position": x.tolist(),
            "angle": float(rng.uniform(-0.5, 0.5)),
        }  # fmt: skip
        if "spin" in features:
            body["velocity"] = rng.uniform(-1.0, 1.0, 2).tolist()
            body["angular_velocity"] = float(rng.uniform(-2.0, 2.0))
        scene["bodies"][name] = body

    def points(place: np.ndarray, count: int) -> list[list[float]]:
        return (place + rng.uniform(-0.35, 0.35, (count, 2))).tolist()

    links = [(i, i + 1) for i in range(bodies - 1)]
    if bodies > 2:
        links.append((0, bodies - 1))
    groups = list(links)
    if "reversed" in features:
        groups += [(j, i) for i, j in links]
    if "several" in features:
        groups += [links[0]]
    if "ground" in features:
        groups += [(-1, 0), (bodies - 1, -1)]
    for n, (i, j) in enumerate(groups):
        count = 1
        for end_name, k, other in ((f"p{n}", i, j), (f"q{n}", j, i)):
            at = centre[k] if k >= 0 else centre[other] + [0.2, -1.4]
            grid = points(at, int(rng.integers(2, 6)))
            scene["points"][end_name] = {"body": names[k] if k >= 0 else "ground", "grid": {"list": grid}}
            count *= len(grid)
        light = min(mass[k] for k in (i, j) if k >= 0)
        frequency = np.exp(rng.uniform(np.log(4.0), np.log(30.0)))
        stiffness = float(2.0 * light * frequency**2 / count)
        law = {"type": "spring", "stiffness": stiffness}
        if "damping" in features:
            law["damping"] = float(stiffness * rng.uniform(0.01, 0.1) / frequency)
        if "preload" in features:
            law["preload"] = float(stiffness * rng.uniform(-0.05, 0.05))
        if "free_length" in features and n == 0:
            law["free_length"] = float(rng.uniform(1.2, 1.6))
        scene["members"][f"g{n}"] = {"from": f"p{n}", "to": f"q{n}", "law": law}
    if "fixed" in features:
        scene["members"][f"g{len(groups) - 1}"]["design"] = False
    if "power" in features:
        scene["design"]["power"] = {name: float(1 + n % 3) for n, name in enumerate(scene["members"])}
        if "fixed" in features:
            del scene["design"]["power"][f"g{len(groups) - 1}"]

    times = 0.05 + end * np.sort(rng.uniform(0.1, 0.9, 3))

    def signal(size: float) -> Any:
        if not {"kinks", "jumps"} & set(features):
            return float(size * rng.uniform(-1, 1))
        # rows before the start, inside, and beyond the end
        rows = [[float(t), float(size * rng.uniform(-1, 1))] for t in (0.0, *times, 0.06 + 1.1 * end)]
        if "jumps" in features:
            rows.insert(3, [rows[2][0], float(size * rng.uniform(-1, 1))])
        return {"table": rows}

    for name, m, at in zip(names, mass, centre, strict=True):
        turn = signal(15.0)
        scene["loads"].append({"body": name, "acceleration": [signal(6.0), signal(6.0)], "angular_acceleration": turn})
        if "off_centre" in features:
            place = (at + rng.uniform(-0.3, 0.3, 2)).tolist()
            scene["loads"].append({"body": name, "force": [signal(2.0 * m), signal(2.0 * m)], "at": place})
        if "follower" in features:
            place = (at + rng.uniform(-0.3, 0.3, 2)).tolist()
            force = [signal(2.0 * m), signal(2.0 * m)]
            scene["loads"].append({"body": name, "force": force, "at": place, "frame": "body"})
    return scene


def random_design(case: Case, seed: int, low: float = 0.05, high: float = 1.0) -> np.ndarray:
    """A random design (N,)."""
    return np.random.default_rng(seed + 1000).uniform(low, high, case.n_design)


def spring_scene(mass: float = 2.0, stiffness: float = 200.0, end: float = 1.0, **changes: Any) -> dict[str, Any]:
    """One body on one horizontal spring to ground, which swings along its line: q'' = -omega^2 (x - 1) + f / m."""
    scene: dict[str, Any] = {
        "time": {"end": end},
        "bodies": {"mass": {"mass": mass, "inertia": 1.0, "position": [1.0, 0.0]}},
        "members": {
            "spring": {
                "from": {"body": "ground", "at": [0.0, 0.0]}, "to": {"body": "mass", "at": [1.0, 0.0]},
                "law": {"type": "spring", "stiffness": stiffness},
            }
        },
        "design": {"initial": 1.0},
        "objectives": {"G": {"response": "energy"}},
    }  # fmt: skip
    scene.update(changes)
    return scene
