"""Which tests `make test` leaves out, for their time: they have the mark `thorough`; `make test-all` runs them, too.

Every promise keeps a test among the others. What is listed here repeats one with another integrator, method, law or
scene; is a whole application; or compiles kernels that few cases need.
"""

import pytest

#: by file below tests/: parts of the names of its tests, which include parameters; an empty one: all of them
THOROUGH: dict[str, tuple[str, ...]] = {
    "applications/test_applications.py": (
        "stored_design_keeps",
        "stored_hand_design",
        "short_run",
        "written_out",
        "cartridges",
        "on_a_slope",
        "the_belt",
    ),
    "applications/test_cargo.py": ("written_out_again_agree",),
    "bench/test_peers.py": ("installed_peers",),
    "compiler/test_processors.py": ("",),
    "distributions/test_brought.py": ("gradients_with_a_law", "a_resumed_one"),
    "docs/test_extending.py": ("worked_examples",),
    "docs/test_pages.py": ("blocks_of_a_page_hold",),
    "engine/test_error_estimate.py": ("[generalized_alpha",),
    "general/test_expression_laws.py": ("alpha",),
    "general/test_projection.py": ("",),
    "optimizer/test_many_forces.py": ("",),
    "space/test_contacts_in_space.py": ("implicit", "collision"),
    "space/test_gauss_in_space.py": ("windows", "gradient", "slopes", "tilted", "energy", "thousands"),
    "space/test_grids_of_springs.py": ("without_the_kernels",),
    "space/test_implicit_steps.py": ("",),
    "space/test_windows.py": ("",),
    "stress/test_stress.py": ("alpha", "periods-", "turns-wheel", "turns-driven", "-slow-"),
    "variables/test_crush.py": ("alpha",),
    "variables/test_parameters.py": ("generalized_alpha",),
    "variables/test_settled.py": ("generalized_alpha",),
}


def _parts(node: str) -> tuple[str, str]:
    """The file of a test below tests/, and its name, from its node."""
    file, _, name = node.removeprefix("tests/").partition("::")
    return file, name


def is_thorough(node: str) -> bool:
    """Whether a test is, by its node: the file from the root of the project, `::`, its name."""
    file, name = _parts(node)
    return any(each in name for each in THOROUGH.get(file, ()))


def without_test(nodes: list[str]) -> list[str]:
    """Entries of the table that are about none of these tests, which are all there are."""
    names: dict[str, list[str]] = {}
    for file, name in map(_parts, nodes):
        names.setdefault(file, []).append(name)
    return [
        f"{file}: {each!r}"
        for file, entries in THOROUGH.items()
        for each in entries
        if not any(each in name for name in names.get(file, ()))
    ]


def mark(items: list[pytest.Item]) -> None:
    """Mark those of the tests that are."""
    for item in items:
        if is_thorough(item.nodeid):
            item.add_marker(pytest.mark.thorough)
