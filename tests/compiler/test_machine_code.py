"""Machine code that is kept on the disk: the same results as through Numba, errors that arrive, no Numba when warm."""

import os
import shutil
import subprocess
import sys
import threading
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest

from mdstopo import evaluate, load_case
from mdstopo.compiler import call, store, tried
from mdstopo.compiler.call import Native
from mdstopo.compiler.entry import types_of
from mdstopo.compiler.jit import entry, kernel

ROOT = Path(__file__).resolve().parents[2]


@kernel
def _norm(x):
    total = 0.0
    for value in x:
        total += value * value
    return np.sqrt(total)


@entry
def mixed(tag, x, table, marks, count, factor, yes, out):
    """Every kind of argument and of result."""
    for i in range(out.shape[0]):
        out[i] = factor * x[i] * count + table[1, i] + tag[1]
    return _norm(out), count + len(tag), yes and bool(marks[0])


@entry
def fails(x, how):
    """Raises what it is asked for."""
    if how == 1:
        raise ValueError("asked for")
    if how == 2:
        return np.empty(1 << 46)[0]
    if how == 3:
        x[:] = np.zeros(x.shape[0] + 1)
    return x[0]


@entry
def reshaped(x, rows):
    """A view of other lengths, of an array that is let go."""
    y = x.copy().reshape((rows, 2))
    return y[y.shape[0] - 1, 1] if rows else -1.0


@entry
def allocates(times, size):
    """Memory taken and given back."""
    total = 0.0
    for k in range(times):
        x = np.zeros(size)
        x[k % size] = 1.0
        total += x.sum()
    return total


@entry
def listed(times):
    """A list that grows, of arrays."""
    total = 0.0
    for _ in range(times):
        several = [np.ones(2)]
        for k in range(1000):
            several.append(np.full(3, float(k)))  # noqa: PERF401  (one after another, so that it grows)
        total += several[-1][2] + len(several)
    return total


@entry
def _first_and_size(x):
    """The first number, and how many there are."""
    return x.flat[0], x.size


@entry
def nothing(x):
    """Returns nothing."""
    x[0] = 3.0


def numba_private():
    found = tried.private()
    assert found is not None
    return found


def _arguments():
    return (0, 7), np.arange(3.0), np.ones((2, 3)), np.array([True]), 4, 0.1, True, np.zeros(3)


def test_machine_code_gives_to_the_bit_what_numba_gives():
    ours, theirs = _arguments(), _arguments()
    found = mixed(*ours)
    expected = mixed._by_numba(*theirs)
    assert found == expected
    assert [type(each) for each in found] == [float, int, bool]
    assert np.array_equal(ours[-1], theirs[-1])
    assert ours[-1][2] == 0.1 * 2.0 * 4 + 1.0 + 7.0


def test_a_prepared_call_takes_other_numbers_and_sees_what_arrays_hold_now():
    arguments = _arguments()
    prepared = mixed.prepare(*arguments)
    arguments[1][:] = 5.0
    size, count, both = prepared((4, 2), (5, 0.5), (6, False))
    assert np.array_equal(arguments[-1], np.full(3, 13.0))
    assert size == pytest.approx(13.0 * np.sqrt(3.0), rel=1e-15)
    assert (count, both) == (4, False)


def test_arguments_of_other_types_than_last_time_go_to_their_own_code():
    @entry
    def doubled(x):
        return 2 * x

    for given in (1, 2.5, True, np.float64(0.5), np.int64(3), False, np.bool_(True), 1, 0.25):
        found = doubled(given)
        assert found == 2 * int(given) if isinstance(given, np.bool_) else found == 2 * given
        assert type(found) is (float if isinstance(given, float) else int)
    assert sorted(doubled._native) == ["b", "f", "i"]
    with pytest.raises(TypeError):
        doubled(1, 2)
    for given in (np.arange(3.0), np.arange(3), np.ones((1, 3)), np.arange(3.0), np.arange(6.0)[::2]):
        assert _first_and_size(given) == (given.flat[0], given.size)


def test_tuples_of_other_kinds_and_lengths_are_told_apart():
    pair = namedtuple("pair", "one other")
    for given in (pair(0, 7), (0, 7), pair(0, 7), (0, 7, 5), (0, 7), (0, True)):
        size, count, both = mixed(given, *_arguments()[1:])
        assert (size, both) == (mixed(*_arguments())[0], mixed(*_arguments())[2]) if given[1] == 7 else size > 0.0
        assert count == 4 + len(given)
    with pytest.raises(TypeError, match="mixed"):
        mixed._native["t2 d1 d2 ?1 i f b d1"](*_arguments()[:-1], np.zeros(3, dtype=np.float32))


def test_what_only_looks_like_an_array_is_none():
    class Likeness:
        __class__ = np.ndarray
        dtype, ndim, flags = np.dtype(np.float64), 1, np.zeros(1).flags

    assert _first_and_size(np.full(3, 2.0)) == (2.0, 3)
    with pytest.raises(TypeError):
        _first_and_size(Likeness())


def test_where_array_objects_are_laid_out_otherwise_numba_calls(monkeypatch):
    monkeypatch.setattr(call, "arrays_are_known", lambda: False)
    other = entry(mixed.py_func)
    assert other(*_arguments()) == mixed(*_arguments())
    assert list(other._native.values()) == [None]


def test_arrays_that_are_read_only_or_empty_are_found_too():
    arguments, others = list(_arguments()), _arguments()
    arguments[1].setflags(write=False)
    assert mixed(*arguments) == mixed(*others)
    arguments[1], arguments[-1] = np.empty(0), np.empty(0)
    assert mixed(*arguments)[0] == 0.0


def test_arrays_that_machine_code_cannot_take_go_through_numba():
    every_other = np.arange(6.0)[::2]
    arguments = list(_arguments())
    arguments[1] = every_other
    assert types_of(tuple(arguments)) is None
    straight = _arguments()
    straight[1][:] = every_other
    assert mixed(*arguments) == mixed(*straight)


def test_an_entry_without_result_returns_none():
    x = np.zeros(2)
    assert nothing(x) is None
    assert x[0] == 3.0


def test_what_a_kernel_raises_arrives():
    assert fails(np.ones(1), 0) == 1.0
    with pytest.raises(ValueError, match="asked for"):
        fails(np.ones(1), 1)
    with pytest.raises(MemoryError):
        fails(np.ones(1), 2)
    with pytest.raises(ValueError):  # noqa: PT011  (its words are put together when it is raised)
        fails(np.ones(2), 3)


def test_views_of_other_lengths_are_right_and_wrong_ones_refused():
    assert reshaped(np.arange(6.0), 3) == 5.0
    assert reshaped(np.zeros(0), 0) == -1.0
    with pytest.raises(ValueError, match="total size"):
        reshaped(np.arange(6.0), 2)


def test_memory_that_kernels_take_is_given_back():
    resource = pytest.importorskip("resource")
    allocates(10, 1_000_000)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert allocates(1000, 1_000_000) == 1000.0  # 8 GB if none came back
    assert listed(1000) == 2000e3  # 130 MB if none came back
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < before + 50_000


def test_code_on_the_disk_that_was_damaged_is_not_used(tmp_path):
    path = tmp_path / "a.code"
    code = store.Code(b"body" * 100, b"glue", "(ib)")
    store.write(path, code)
    assert store.read(path) == code
    data = path.read_bytes()
    for damaged in (data[:-1], data[:10], b"", data.replace(b"bodybody", b"bodyxody", 1), data[:20] + b"}" + data[20:]):
        path.write_bytes(damaged)
        assert store.read(path) is None
    assert store.read(tmp_path / "none.code") is None


def test_of_several_processes_one_compiles_and_the_others_find_it(tmp_path, monkeypatch):
    @entry
    def doubled(x):
        return 2.0 * x[0]

    other = entry(doubled.py_func)
    path = tmp_path / "doubled.code"
    monkeypatch.setattr(store, "path_of", lambda *_: path)
    builds = []
    private = numba_private()
    compiled = private.build

    def slowly(*arguments):
        builds.append(threading.get_ident())
        waiting.start()
        waiting.join(0.3)
        assert waiting.is_alive()  # it does not compile beside us
        return compiled(*arguments)

    monkeypatch.setattr(private, "build", slowly)
    found = []
    waiting = threading.Thread(target=lambda: found.append(other(np.full(1, 3.0))))
    assert doubled(np.full(1, 2.0)) == 4.0
    waiting.join()
    assert found == [6.0]
    assert builds == [threading.get_ident()]
    assert sorted(each.name for each in tmp_path.iterdir()) == ["doubled.code"]


def test_code_that_needs_more_of_numba_than_is_provided_goes_through_numba(monkeypatch):
    @entry
    def summed(x):
        return np.zeros(3).sum() + x[0]

    from mdstopo.compiler.numba_private import entry_code

    private = numba_private()
    monkeypatch.setattr(entry_code, "PROVIDED", frozenset())
    assert private.build(summed.dispatcher, "d1") is None
    assert summed(np.full(1, 2.0)) == 2.0
    assert summed._native == {"d1": None}


def test_kernels_are_not_called_from_python():
    with pytest.raises(TypeError, match="py_func"):
        _norm(np.ones(2))


def test_machine_code_read_from_the_disk_is_what_was_kept():
    arguments = _arguments()
    expected = mixed(*arguments)
    types = types_of(arguments)
    code = store.read(store.path_of(mixed.py_func.__module__, "mixed", types))
    assert code is not None
    again = _arguments()
    assert Native("mixed", code, types)(*again) == expected
    assert np.array_equal(again[-1], arguments[-1])


CHECK = """
import sys
import mdstopo
found = mdstopo.evaluate(mdstopo.load_case(sys.argv[1]))
print(repr(found.objectives["G"]), found.gradients["G"].tobytes().hex()[:64], "numba" in sys.modules)
"""


@pytest.mark.parametrize("case", ["cases/fig6.yaml", "tests/general/cases"])
def test_a_warm_process_gives_the_same_without_importing_numba(case, tmp_path):
    path = ROOT / case
    path = next(iter(sorted(path.glob("*.yaml")))) if path.is_dir() else path
    here = evaluate(load_case(path))  # kernels are on the disk from here on
    script = tmp_path / "check.py"
    script.write_text(CHECK)
    done = subprocess.run(
        [sys.executable, str(script), str(path)],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert done.stdout.split() == [repr(here.objectives["G"]), here.gradients["G"].tobytes().hex()[:64], "False"]


def test_a_type_of_a_structure_is_found_by_the_process_that_reads_it():
    """A kernel's disk cache lists all the types that it was compiled for, and reading it asks for each of them, also in
    processes that have springs only. A copy in the cache would be another type there, without attributes."""
    kept = (
        "from mdstopo.compiler.kernel import numba\n"
        "from mdstopo.general.model import bundles, general_model\n"
        "numba()\n"
        "from numba.core.serialize import dumps\n"
        "print(dumps(bundles.KINDS['PlanarViewStructure']).hex())\n"
    )
    read = (
        "import pickle, sys; from mdstopo.general import structures\n"
        "first = dir(structures)\n"
        "print(pickle.loads(bytes.fromhex(sys.stdin.read())) is structures.PlanarViewStructure)\n"
        "print(structures.WorkspaceStructure.__name__)\n"
        "made = [name for name in dir(structures) if name.endswith('Structure') and name not in first]\n"
        "print('ENDING' in first, bool(made), all(isinstance(getattr(structures, name), type) for name in made))\n"
    )
    text = ""
    for script in (kept, read):
        command = [sys.executable, "-c", script]
        text = subprocess.run(command, input=text, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert text.split() == ["True", "WorkspaceStructure", "True", "True", "True"]  # and dir() shows those that are made


INSIDE = """
import sys
import numpy as np
from mdstopo.compiler.jit import entry, kernel, member_kernel

@member_kernel
def total(x):
    s = 0.0
    for i in range(x.shape[0]):
        s += x[i]
    return s

@kernel
def mean(x):
    return total(x) / x.shape[0]

@entry
def twice(x):
    return 2.0 * mean(x)

@kernel
def spread(x, middle):
    # functions of Numba's own: of more than one kind, some of which it compiles late
    room = np.zeros((2, x.shape[0]))
    room[1] = x.reshape((x.shape[0], 1))[:, 0]
    s = min(max(room[1].sum() - x.sum(), 0.0), np.empty(min(2, x.shape[0])).size - 2.0)
    for i in range(x.shape[0]):
        s += abs(x[i] - middle)
    return s / total(x)

@entry
def mean_and_spread(x):
    return mean(x), spread(x, mean(x))

if __name__ == "__main__":
    if "command line" in sys.argv:
        import mdstopo.cli
    if "others use Numba" in sys.argv:
        import numba
        others = numba.njit(lambda x: min(x[0], 2.0) + max(x[0], 1.0) + x.sum() + np.zeros((2, 3)).sum())
        assert others(np.ones(2)) == 4.0
    if "spread first" in sys.argv:
        mean_and_spread(np.arange(100.0))
    found = twice(np.arange(100.0))
    mean_and_spread(np.arange(100.0))
    inside = [total.dispatcher, mean.dispatcher]
    hits = [sum(each._cache_hits.values()) for each in inside]
    kept = [next(iter(each.overloads.values())).library for each in inside if each.overloads]
    print(found, *hits, any(each._object_caching_enabled for each in kept), *(type(each).__name__ for each in kept))
"""


def test_functions_inside_entries_are_kept_without_machine_code_and_found_by_other_processes(tmp_path):
    script = tmp_path / "inside.py"
    script.write_text(INSIDE)
    env = os.environ | {"PYTHONPATH": str(ROOT), "MDSTOPO_CACHE_DIR": str(tmp_path / "cache")}

    def run():
        done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True, env=env)
        return done.stdout.split()

    assert run() == ["99.0", "0", "0", "False", "Optimised", "Left"]
    for code in (tmp_path / "cache").rglob("*.code"):
        code.unlink()
    assert run()[:3] == ["99.0", "0", "1"]  # what a function calls comes with it


@pytest.mark.skipif(
    tried.versions() < ("0.68", "0.50"),
    reason="Numba names constants after places in memory: files differ, code does not",
)
def test_machine_code_does_not_depend_on_what_was_compiled_before(tmp_path):
    script = tmp_path / "inside.py"
    script.write_text(INSIDE)

    def codes(number, *order, before=None):
        """The files of a process with a cache of its own, by name; of functions inside entries those of `before`."""
        cache = tmp_path / f"cache-{number}"
        if before is not None:
            shutil.copytree(before, cache)
            for code in cache.rglob("*.code"):
                code.unlink()
        env = os.environ | {"PYTHONPATH": str(ROOT), "MDSTOPO_CACHE_DIR": str(cache), "PYTHONHASHSEED": str(number)}
        subprocess.run([sys.executable, str(script), *order], check=True, env=env, stdout=subprocess.DEVNULL)
        return {file.name: file.read_bytes() for file in cache.rglob("*.code")}

    first = codes(1)
    assert len(first) == 2
    assert codes(2, "spread first") == first
    assert codes(3, "spread first", before=tmp_path / "cache-1") == first
    assert codes(4, "command line") == first
    assert codes(5, "others use Numba", "spread first") == first


WHOLE = """
import mdstopo
from mdstopo.engine import Evaluator

case = mdstopo.load_case("restraint")
Evaluator(case).evaluate(case.initial, gradient=False)
"""


@pytest.mark.skipif(
    tried.versions() < ("0.68", "0.50"),
    reason="Numba names constants after places in memory: files differ, code does not",
)
def test_the_kernels_of_a_scene_with_joints_are_the_same_files_in_every_process(tmp_path):
    caches = [tmp_path / str(seed) for seed in (1, 2)]
    started = []
    for seed, cache in enumerate(caches, start=1):
        env = os.environ | {"PYTHONPATH": str(ROOT), "MDSTOPO_CACHE_DIR": str(cache), "PYTHONHASHSEED": str(seed)}
        started.append(subprocess.Popen([sys.executable, "-c", WHOLE], env=env))
    assert [each.wait() for each in started] == [0, 0]
    first, second = ({file.name: file.read_bytes() for file in cache.glob("kernels-*/*-*.code")} for cache in caches)
    assert len(first) > 20
    assert first.keys() == second.keys()
    assert [name for name in first if first[name] != second[name]] == []
    kept = [{file.name for file in cache.glob("kernels-*/unit-*.kept")} for cache in caches]
    assert kept[0] == kept[1]
