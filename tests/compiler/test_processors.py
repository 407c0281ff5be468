"""Another kind of processor computes the same, to rounding: what docs/accuracy.md says of it.

Run as a module, this prints the numbers of that page.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from mdstopo import evaluate
from tests.engine.scenes import FEATURES, random_design, random_scene, read

ROOT = Path(__file__).resolve().parents[2]
FEW, MANY = 12, 60
#: far above what was found (docs/accuracy.md), far below the tolerance of the scenes
NEAR = 1e-11
STATED = {"NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_ENABLE_AVX"}


def found(seed: int) -> dict[str, list[float]]:
    """The value and the gradient of a random scene."""
    features = sorted(FEATURES)
    chosen = np.random.default_rng(seed).permutation(len(features))[:3]
    case = read(random_scene(seed, *(features[k] for k in chosen)))
    one = evaluate(case, random_design(case, seed))
    return {"value": [one.objectives["G"]], "gradient": one.gradients["G"].tolist()}


def elsewhere(count: int, **setting: str) -> list[dict[str, list[float]]]:
    """The same of so many scenes, by kernels for another processor."""
    program = (
        "import json\n"
        "from tests.compiler.test_processors import found\n"
        f"print(json.dumps([found(seed) for seed in range({count})]))\n"
    )
    environment = {name: value for name, value in os.environ.items() if name not in STATED} | setting
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    answer: list[dict[str, list[float]]] = json.loads(done.stdout.splitlines()[-1])
    return answer


def differences(count: int) -> tuple[list[float], list[float]]:
    """Of values, and of gradients relative to the largest entry: between plain x86-64 and here, of each scene."""
    apart: dict[str, list[float]] = {"value": [], "gradient": []}
    for seed, there in enumerate(elsewhere(count, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")):
        for name, here in found(seed).items():
            one, two = np.array(here), np.array(there[name])
            largest = np.abs(one).max(initial=0.0)
            if largest > 0.0:
                apart[name].append(float(np.abs(one - two).max() / largest))
    return apart["value"], apart["gradient"]


def test_a_processor_without_wide_vectors_and_fused_products_computes_the_same_to_rounding() -> None:
    values, gradients = differences(FEW)
    assert len(values) > FEW / 2
    assert max(*values, *gradients) <= NEAR


def test_the_same_processor_computes_the_same_to_the_bit_in_another_process() -> None:
    other = elsewhere(FEW, **{name: os.environ[name] for name in STATED & os.environ.keys()})
    assert other == [found(seed) for seed in range(FEW)]


if __name__ == "__main__":
    values, gradients = differences(MANY)
    print(
        f"{len(values)} scenes; the largest difference of values {max(values):.0e}, of gradients {max(gradients):.0e}"
    )
