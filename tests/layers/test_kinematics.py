"""The seam of kinematics: no code above it knows how many numbers a body has, and every function of it has a kernel."""

from __future__ import annotations

import inspect
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from mdstopo.compiler.kernel import Kernel
from mdstopo.mechanics.joints.joint_table import LISTED
from mdstopo.mechanics.kinematics import kinematics_interface
from mdstopo.mechanics.kinematics.planar import PLANAR

from .test_imports import ROOT

GENERAL = ROOT / "mdstopo" / "general"
#: what a stride of a body in a plane, of a pair of them, or of a joint's rows looks like
STRIDE = re.compile(
    r"(?<![\w.\-])[36] \* [a-z]"  # 3 * body
    r"|// [36](?![\w.])|% [36](?![\w.])"  # d // 3, d % 3
    r"|range\([36]\)|repeat=[36]"  # range(6)
    r"|np\.(?:empty|zeros|ones|full|tile)\(\(?(?:[^()]*, )?[36](?:, [36])?\)"  # np.empty((n_pair, 6, 6))
    r"|reshape\([^()]*(?<!\w)[36]\)"  # reshape(-1, 3)
)
#: lines that look like one and are none: where, what stands there, and what it is
NO_STRIDES = {
    ("accelerations.py", "3 * model.size[1] + 1"): "a banded matrix with room for its pivots",
    ("accelerations.py", "3 * both * both"): "K, C and the mass of a pair",
    ("gauss_window.py", "6 * n"): "changes of a node's state, and inverse masses",
    ("rows_with_gradients.py", "np.empty(3)"): "a response, its rate and its member",
    ("priced_candidates.py", "range(3)"): "what a law's modes are, and what a step is",
    ("compile_general.py", "reshape(-1, 6)"): "columns of a response",
    ("general_driver.py", "reshape(events, 6)"): "columns of an event",
    ("generalized_alpha_step.py", "range(3)"): "names of columns",
    ("members.py", "range(3)"): "names of columns",
    ("general_model.py", "range(6)"): "names of columns",
    ("peak_search.py", "range(3)"): "names of columns",
    ("peak_search.py", "np.empty(3)"): "a response, its rate and its member",
    ("peak_search.py", "np.empty((count, SAMPLES, 3))"): "a response, its rate and its member",
    ("general_responses.py", "range(3)"): "coordinates, velocities, accelerations; terms of a difference",
    ("settle.py", "range(3)"): "how often it lands",
    ("step_history.py", "range(3)"): "names of columns",
    ("step_history.py", "range(6)"): "names of columns",
}
#: modules that say what is planar, or spatial, when a case is compiled
OF_ONE_DIMENSION = {"planar_scene.py", "spatial_scene.py", "turning_drives.py"}
#: modules that take something of the plane itself, and what
OF_THE_PLANE = {
    "generalized_alpha.py": {"planar_poses"},  # copy_rows, which copies any rows
    "generalized_alpha_switch.py": {"planar_poses"},  # likewise
    "general_model.py": {"planar"},  # says how the bodies of this model move
    "planar_scene.py": {"planar"},  # what is planar when a case is compiled
    "gather.py": {"planar_poses"},
    "step_linear.py": {"planar_poses"},
}


def code_lines(path: Path) -> Iterator[tuple[int, str]]:
    """The lines of a module without texts and comments."""
    lines = path.read_text(encoding="utf-8").splitlines()
    with path.open("rb") as file:
        for token in tokenize.tokenize(file.readline):
            if token.type in (tokenize.STRING, tokenize.COMMENT):
                for row in range(token.start[0], token.end[0] + 1):
                    line = lines[row - 1]
                    begin = token.start[1] if row == token.start[0] else 0
                    end = token.end[1] if row == token.end[0] else len(line)
                    lines[row - 1] = line[:begin] + " " * (end - begin) + line[end:]
    yield from enumerate(lines, start=1)


def test_nothing_above_kinematics_has_the_stride_of_a_body() -> None:
    found, used = [], set()
    for path in sorted(GENERAL.rglob("*.py")):
        if path.name in OF_ONE_DIMENSION:
            continue
        for number, line in code_lines(path):
            if not STRIDE.search(line):
                continue
            allowed = {key for key in NO_STRIDES if key[0] == path.name and key[1] in line}
            used |= allowed
            if not allowed:
                found.append(f"{path.name}:{number}: {line.strip()}")
    assert not found, "\n".join(found)
    assert used == NO_STRIDES.keys(), f"no longer needed: {NO_STRIDES.keys() - used}"


@pytest.mark.parametrize(
    "line",
    [
        "a = 3 * model.pair[p, 0]",
        "for i in range(6):",
        "angle = d - d % 3 + 2",
        "body = d // 3",
        "k = np.zeros((n_pair, 6, 6))",
        "rows = np.empty((2, 6))",
        "mine = np.empty(3)",
        "bodies = v.reshape(-1, 3)",
        "arms = np.tile(x, 3)",
    ],
)
def test_a_stride_is_found(line: str) -> None:
    assert STRIDE.search(line)


@pytest.mark.parametrize(
    "line", ["x = 1e-3 * size", "bars = np.empty((3, n))", "y = 6.0 * tau", "range(30)", "c = -6 + n", "q[3 : 6]"]
)
def test_other_numbers_are_no_strides(line: str) -> None:
    assert not STRIDE.search(line)


def test_modules_above_kinematics_do_not_ask_the_plane() -> None:
    found: dict[str, set[str]] = {}
    for path in GENERAL.rglob("*.py"):
        named = set(re.findall(r"mechanics\.kinematics\.(planar\w*)", path.read_text(encoding="utf-8")))
        if named:
            found[path.name] = named
    assert found == OF_THE_PLANE


def test_every_function_of_the_interface_has_a_kernel_with_its_arguments() -> None:
    kernels = PLANAR.kernels
    missing = kinematics_interface.INTERFACE.keys() - kernels.keys()
    assert missing == {"turn_motion", "tilt_motion"}
    assert missing < kinematics_interface.OPTIONAL
    assert kernels.keys() < kinematics_interface.INTERFACE.keys()
    for name in kernels:
        asked = kinematics_interface.INTERFACE[name]
        assert isinstance(kernels[name], Kernel)
        assert list(inspect.signature(kernels[name].py_func).parameters) == list(inspect.signature(asked).parameters)


def test_sizes_of_kernels_are_those_that_python_knows() -> None:
    for name, size in (
        ("coordinates", PLANAR.coordinates),
        ("freedoms", PLANAR.freedoms),
        ("rotations", PLANAR.rotations),
        ("attitude", PLANAR.attitude),
        ("most_rows", PLANAR.rows),
    ):
        assert PLANAR.kernels[name].py_func(None) == size
    assert max(each.rows for each in LISTED) == PLANAR.rows


def test_what_is_retracted_by_a_difference_arrives() -> None:
    before, after = np.random.default_rng(1).normal(size=(2, 4 * PLANAR.coordinates))
    shift = PLANAR.difference(after, before)
    assert np.allclose(PLANAR.retract(before, shift), after, rtol=0.0, atol=1e-15)
    move, turn = PLANAR.shifts_and_turns(shift)
    assert move.shape == (4, PLANAR.freedoms - PLANAR.rotations)
    assert turn.shape == (4, PLANAR.rotations)
    assert np.shares_memory(move, shift)
