"""Random stacks of bodies that come to rest on legs with plateaus and gaps: every one finds its minimum of energy."""

import numpy as np
import pytest
import yaml
from scipy.optimize import minimize

from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.engine import Evaluator

GRAVITY = 9.81


def stack(seed):
    """One or two bodies above each other on two to four legs each, with springs to the sides; as text."""
    rng = np.random.default_rng(seed)
    mass = rng.uniform(2, 12, int(rng.integers(1, 3)))
    bodies = {
        f"b{i}": {"mass": float(m), "inertia": float(rng.uniform(0.1, 1)), "position": [0, 1 + i]}
        for i, m in enumerate(mass)
    }
    members = []
    for i in range(len(mass)):
        below, low = ("ground", 0.0) if i == 0 else (f"b{i - 1}", i + 0.2)
        legs = int(rng.integers(2, 5))
        for j in range(legs):
            x = -0.4 + 0.8 * j / (legs - 1) + rng.uniform(-0.1, 0.1)
            foot = float(x + rng.uniform(-0.35, 0.35))
            stiffness = float(rng.uniform(500, 8000))
            law = {
                "crush": {
                    "force": float(rng.uniform(0.15, 1.2) * mass[i:].sum() * GRAVITY),
                    "gap": float(rng.uniform(-0.01, 0.02)),
                },
                "gap": {"side": "compression", "gap": float(rng.uniform(0, 0.03))},
                "spring": {},
            }
            kind = str(rng.choice(["crush", "crush", "gap", "spring"]))
            members.append((below, [foot, low], f"b{i}", [float(x), i + 0.8], {"stiffness": stiffness, **law[kind]}))
            members[-1][-1]["type"] = kind
        for _ in range(int(rng.integers(1, 3))):
            side = float(rng.choice([-1, 1]))
            law = {"type": "spring", "stiffness": float(rng.uniform(100, 1500))}
            members.append(("ground", [2 * side, float(rng.uniform(0.5, 2.5))], f"b{i}", [0.3 * side, 1.0 + i], law))
    ends = {
        f"m{k}": {"from": {"body": a, "at": p}, "to": {"body": b, "at": q}, "law": law}
        for k, (a, p, b, q, law) in enumerate(members)
    }
    return yaml.safe_dump(
        {
            "format": 1,
            "gravity": [0, -GRAVITY],
            "time": {"end": 0.1},
            "bodies": bodies,
            "members": ends,
            "design": {"initial": 1},
            "solver": {"settle": True},
        },
        sort_keys=False,
    )


def at_rest(law, x):
    """V, f of a law that is only drawn out from its stated length by x."""
    k = law["stiffness"]
    if law["type"] == "spring":
        return 0.5 * k * x * x, k * x
    y = max(-x - law["gap"], 0.0)
    most = law.get("force", np.inf) / k
    return (0.5 * k * y * y, -k * y) if y < most else (k * most * (y - 0.5 * most), -k * most)


class Energy:
    """Of such a stack, with its slope: written apart from the tool's own."""

    def __init__(self, text):
        stated = yaml.safe_load(text)
        bodies = stated["bodies"]
        self.weight = GRAVITY * np.array([body["mass"] for body in bodies.values()])
        self.start = np.array([[*body["position"], 0.0] for body in bodies.values()]).ravel()
        places = {"ground": (-1, np.zeros(2))}
        places |= {name: (i, np.array(body["position"])) for i, (name, body) in enumerate(bodies.items())}
        self.members = []
        for group in stated["members"].values():
            ends = [
                (places[end["body"]][0], np.array(end["at"]) - places[end["body"]][1])
                for end in (group["from"], group["to"])
            ]
            length = float(np.hypot(*np.subtract(group["to"]["at"], group["from"]["at"])))
            self.members.append((ends, group["law"], length))

    def __call__(self, q):
        total = float(self.weight @ q[1::3])
        slope = np.zeros_like(q)
        slope[1::3] = self.weight
        for ends, law, length in self.members:
            points, turned = [], []
            for body, own in ends:
                x, y, angle = q[3 * body : 3 * body + 3] if body >= 0 else np.zeros(3)
                arm = complex(*own) * np.exp(1j * angle)
                points.append(complex(x, y) + arm)
                turned.append(1j * arm)
            span = points[1] - points[0]
            stored, force = at_rest(law, abs(span) - length)
            total += stored
            pull = force * span / abs(span)
            for (body, _), by_angle, sign in zip(ends, turned, (-1.0, 1.0), strict=True):
                if body >= 0:
                    own = [pull.real, pull.imag, (pull.conjugate() * by_angle).real]
                    slope[3 * body : 3 * body + 3] += sign * np.array(own)
        return total, slope


@pytest.mark.parametrize("seed", range(40))
def test_a_stack_on_legs_with_plateaus_and_gaps_rests_where_its_energy_is_least(seed):
    text = stack(seed)
    case, energy = read_case(text), Energy(text)
    found = Evaluator(case).settled(np.ones(case.n_design), "default")
    assert found is not None
    q = energy.start + found.q[: len(energy.start)]
    least, slope = energy(q)
    assert np.abs(slope).max() <= 1e-8 * energy.weight.max()
    assert least < energy(energy.start)[0]
    rng = np.random.default_rng(seed)
    for direction in rng.normal(size=(20, len(q))):
        assert energy(q + 1e-4 * direction)[0] > least
    box = [(x - 0.01, x + 0.01) for x in q]
    for _ in range(3):
        near = q + 0.01 * rng.uniform(-1, 1, len(q))
        other = minimize(energy, near, jac=True, method="L-BFGS-B", bounds=box, options={"ftol": 0, "gtol": 1e-9})
        inside = np.abs(other.x - q).max() < 0.00999  # at the edge it is on its way to another minimum
        assert other.fun >= least - 1e-10 * abs(least) or not inside


def test_what_cannot_carry_its_load_is_refused_though_each_of_its_legs_has_a_plateau():
    stated = yaml.safe_load(stack(0))
    for group in stated["members"].values():
        group["law"] = {"type": "crush", "stiffness": 900.0, "force": 1.0}
    case = read_case(yaml.safe_dump(stated, sort_keys=False))
    with pytest.raises(CaseError, match=r"solver\.settle: body b\d finds no static equilibrium"):
        Evaluator(case).settled(np.ones(case.n_design), "default")
