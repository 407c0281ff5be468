"""Arrays that are cut out of one piece of memory lie in it behind each other: none overlaps, and nothing is left."""

import sys
from functools import partial
from types import SimpleNamespace

import pytest

from mdstopo.case.reader import read_case
from mdstopo.compiler.vector import WIDE
from mdstopo.general.dynamics import accelerations
from mdstopo.general.integrators import gauss_window
from mdstopo.general.scene.compile_general import compile_general
from mdstopo.mechanics.kinematics.kinematics_interface import INTERFACE
from tests.general.test_joint_matrix import MECHANISM, PARALLELOGRAM
from tests.space.in_python import in_python  # noqa: F401  (a fixture)
from tests.space.test_scene_arrays import HULL, JOINTS

FREE = """
format: 1
time: {end: 1}
bodies:
  a: {mass: 2, inertia: 3, position: [0, 0]}
  b: {mass: 4, inertia: 5, position: [2, 0]}
members:
  belt: {from: {body: a, at: [0, 1]}, to: {body: b, at: [2, 1]}, law: {type: spring, stiffness: 225, damping: 3}}
"""
SCENES = {
    "free": FREE,
    "linkage": PARALLELOGRAM,
    "mechanism": MECHANISM.replace("LAW", "{type: inerter, inertance: 3}"),
    "free in space": HULL,
    "joints in space": HULL + JOINTS,
}


def _named(names, *arrays):
    """A structure as Python, which kernels alone can make."""
    return SimpleNamespace(**dict(zip(names, arrays, strict=True)))


@pytest.fixture(params=SCENES)
def model(request, monkeypatch, in_python):  # noqa: F811
    """A scene, whose kernels can be called as Python: what bodies are is that of its dimension."""
    case = read_case(SCENES[request.param])
    scene = compile_general(case, case.load_cases[0])
    modules = [each for name, each in sys.modules.items() if name.startswith("mdstopo.")]
    for name, kernel in scene.kinematics.kernels.items():
        for module in modules:
            if getattr(module, name, None) is INTERFACE[name]:
                monkeypatch.setattr(module, name, kernel)
    for module, maker in ((accelerations, "Workspace"), (gauss_window, "Nodes")):
        monkeypatch.setattr(module, maker, partial(_named, module.FIELDS))
    return scene.model


def gaps_of(arrays):
    """Of each piece of memory that several arrays are cut out of, the bytes before, between and behind these."""
    cut = {}
    for array in arrays:
        if array.base is not None and array.size:
            cut.setdefault(id(array.base), []).append(array)
    found = []
    for parts in cut.values():
        if len(parts) > 1:
            piece = parts[0].base
            behind = piece.ctypes.data
            gaps = []
            for start, size in sorted((each.ctypes.data, each.nbytes) for each in parts):
                gaps.append(start - behind)
                behind = start + size
            found.append([*gaps, piece.ctypes.data + piece.nbytes - behind])
    return found


def test_a_workspace_fills_its_rooms(model):
    numbers, room = sorted(gaps_of(vars(accelerations.make_workspace(model)).values()), key=len)
    assert len(numbers) > 3
    assert not any(numbers)
    assert len(room) > 10
    assert not any(room)


def test_the_nodes_of_a_window_fill_their_rows_and_their_room(model):
    room, rows = sorted(gaps_of(vars(gauss_window.make_nodes(model)).values()), key=len)
    assert len(room) >= 8
    assert not any(room)
    # rows begin where a vector may, anywhere within the first one
    assert len(rows) > 10
    assert not any(rows[1:-1])
    assert rows[0] + rows[-1] == 8 * WIDE
