"""Which tests `make test` leaves out, for their time: they have the mark `thorough`; `make test-all` runs them, too.

Every promise keeps a test among the others. What is listed here repeats one with another integrator, method, law or
scene; is a whole application; or compiles kernels that few cases need. Of random examples of a property
`make test` tries fewer (`examples`).
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
    "bench/test_damage.py": ("lose_nothing",),
    "bench/test_hunt.py": ("second_model[4", "second_model[10", "second_model[209"),
    "bench/test_hunt_space.py": ("second_model[1", "second_model[4"),
    "bench/test_optimum.py": ("rows[belts product", "rows[machine"),
    "bench/test_peers.py": ("installed_peers", "jax_moves_as_ours"),
    "bench/test_peers_in_space.py": ("installed_peers",),
    "case/test_fuzz.py": ("place[2", "place[3"),
    "cli/test_cli_commands.py": ("goes_on[2-", "goes_on[1-pareto"),
    "cli/test_finalize.py": ("a_fixed_step_is_verified",),
    "cli/test_plot_export_new.py": ("starter_case_is_right", "to_the_byte[pdf"),
    "cli/test_surroundings.py": (
        "spelt[ascii",
        "spelt[latin",
        "Bad file descriptor-check a.yaml --json",
        "Bad file descriptor-schema",
        "No space left on device-check a.yaml]",
        "No space left on device---version",
    ),
    "compiler/test_cache_safety.py": ("damaged_files_of_the_cache",),
    "compiler/test_machine_code.py": (
        "does_not_depend_on_what_was_compiled_before",
        "same_files_in_every_process",
        "functions_inside_entries_are_kept",
    ),
    "compiler/test_processors.py": ("",),
    "compiler/test_tried.py": (
        "[a version that was not tried",
        "[a name that is missing",
        "[code that computes",
        "[machine code that asks",
        "[allocations with another header",
    ),
    "compiler/test_units.py": ("missing_or_damaged_of_it", "without_intermediate"),
    "compiler/test_vector.py": ("same_numbers[without AVX",),
    "distributions/test_brought.py": ("gradients_with_a_law", "a_resumed_one"),
    "docs/test_extending.py": ("worked_examples",),
    "docs/test_gallery.py": ("[vehicle",),
    "docs/test_notebook.py": ("cells_run",),
    "docs/test_pages.py": ("blocks_of_a_page_hold",),
    "docs/test_results.py": ("every_dataset_of_a_result",),
    "docs/test_site.py": ("",),
    "engine/test_error_estimate.py": ("[generalized_alpha", "random_scenes[runge_kutta"),
    "engine/test_golden.py": ("[mooring", "[occupant", "[touchdown", "[restraint", "[tiedown", "[fig6-uncertain"),
    "engine/test_reprs.py": ("mistake_for_type_checkers",),
    "engine/test_trajectories.py": (
        "integrator[several bodies-runge_kutta",
        "integrator[damped-gauss",
        "integrator[loads-runge_kutta",
        "integrator[kinks-gauss",
        "integrator[everything undamped",
    ),
    "fit/test_fits.py": ("intervals_hold_the_truth", "many_more_motions"),
    "front/test_cluster.py": ("dies_in_mid_sweep", "scheduler_that_dies", "a_sweep_runs_on"),
    "front/test_failures.py": ("beyond_a_constraint_are_off",),
    "front/test_fronts.py": (
        "21_points",
        "that_is_killed_goes_on",
        "three_objectives_make",
        "test_workers_change_nothing",
    ),
    "front/test_priced_fronts.py": ("a_stopped_front", "mirror_images", "runs_of_a_sweep"),
    "front/test_starts.py": ("with_several_starts_ends_the_same", "resumed_with_another_number"),
    "general/test_candidate_prices.py": (
        "in_space",
        "crushed_by_different_lengths",
        "become_shorter[crushed later",
        "become_shorter[slack, mean",
        "become_shorter[slack, root",
        "modes_computes_few_of_the_prices_and_knows_all[damped",
        "modes_computes_few_of_the_prices_and_knows_all[steered",
        "modes_computes_few_of_the_prices_and_knows_all[several",
    ),
    "general/test_contact.py": (
        "agree[solver1]",
        "equation[0.001-1e-08",
        "equation[0.0001-1e-12",
        "equation[0.0001-1e-06",
        "equation[0.0001-1e-08",
        "equation[0.0001-1e-10",
        "equation[1e-05",
    ),
    "general/test_crush.py": ("agree[solver1]",),
    "general/test_error_estimate.py": ("twenty[1e-05",),
    "general/test_esdirk.py": ("digits[500.0", "digits[5000.0"),
    "general/test_expression_laws.py": (
        "alpha",
        "in_space_are_slopes",
        "kinks_are_slopes[brown_mcphee",
        "kinks_are_slopes[hunt_crossley",
        "kinks_are_slopes[two_slopes",
        "kinks_are_slopes[length",
    ),
    "general/test_formulas_of_time.py": ("steps_of_collocation",),
    "general/test_gauss_in_plane.py": ("tilted", "fourteen", "however_long", "explicit_or_implicit"),
    "general/test_gradients.py": ("agree[everything-", "computed[everything-generalized_alpha"),
    "general/test_integrands.py": (
        "passes_zero[integral-adjoint",
        "passes_zero[mean-direct",
        "zero_are_those_of_the_values[0.3",
        "zero_are_those_of_the_values[0.03-direct",
    ),
    "general/test_joints_in_motion.py": ("shares_the_load[generalized_alpha",),
    "general/test_methods.py": ("motions[generalized_alpha",),
    "general/test_peak_search.py": ("-alpha]",),
    "general/test_projection.py": ("",),
    "general/test_row_sweep.py": ("-alpha]", "[everything-"),
    "general/test_settle.py": ("nothing_to_settle[1", "nothing_to_settle[2", "nothing_to_settle[3"),
    "general/test_settle_kinks.py": ("[1", "[2", "[3", "[5", "[6", "[7", "[8", "[9"),
    "general/test_since_settled.py": ("implicit",),
    "general/test_singular_poses.py": ("poses[40-1e-08", "gradients_go_through_singular_poses[1e-06", "poses[1e-10"),
    "limiting/test_bounds.py": (
        "beyond_the_bound[1",
        "beyond_the_bound[2",
        "beyond_the_bound[3",
        "beyond_the_bound[4",
        "beyond_the_bound[5",
        "beyond_the_bound[6",
        "beyond_the_bound[7",
        "beyond_the_bound[8",
        "beyond_the_bound[9",
    ),
    "limiting/test_closed_forms.py": (
        "travel[norm-max-0.1",
        "travel[norm-max-40.0",
        "travel[x-max_abs-40.0",
        "base[0.07",
        "discretisation[t",
    ),
    "mechanics/test_grids.py": ("[iterative",),
    "mechanics/test_joints.py": ("acceleration_rows[fixed", "acceleration_rows[distance"),
    "optimizer/test_competing.py": ("optimum[False-1", "optimum[False-2", "optimum[True-1", "optimum[True-2"),
    "optimizer/test_many_forces.py": ("",),
    "optimizer/test_wide.py": ("shifts[2.0-12000", "shifts[0.05-12000", "do[1020", "do[8197", "shifts[0.2-12000"),
    "published/test_published.py": ("two_thousand_seconds", "hundred_periods"),
    "robust/test_runs.py": (
        "{measure: mean_deviation",
        "{measure: quantile",
        "{measure: worst",
        "several_starts_on",
        "share_of_a_worker",
        "fronts_of_uncertain",
    ),
    "sensitivity/test_agreement.py": ("generalized_alpha",),
    "sensitivity/test_candidate_prices.py": ("[runge_kutta", "[generalized_alpha"),
    "session/test_priced_candidates.py": ("bit[20", "bit[45", "members_with_slack"),
    "session/test_runs_and_files.py": ("after_the_iteration[2",),
    "session/test_size_search.py": ("best_of_all_choices[2", "best_of_all_choices[3", "best_of_all_choices[4"),
    "session/test_sizes.py": ("stopped_choice",),
    "session/test_starts_in_quotas.py": (
        "been[30",
        "been[45",
        "been[70",
        "been[125",
        "been[150",
        "beginning[1-2",
        "beginning[1-9",
        "beginning[4-",
        "beginning[9-None",
    ),
    "space/test_bushings.py": ("slopes[gauss",),
    "space/test_contacts_in_space.py": ("implicit", "collision", "gradients_through_contacts"),
    "space/test_driven_bodies.py": ("gradients_with_driven", "half_a_turn_in_a_step[628"),
    "space/test_gauss_in_space.py": ("windows", "gradient", "slopes", "tilted", "energy", "thousands"),
    "space/test_gradients.py": ("springs_alone",),
    "space/test_gradients_in_space.py": ("",),
    "space/test_grids_of_springs.py": ("without_the_kernels", "gauss"),
    "space/test_half_turns_looked_at.py": ("without_an_error_estimate",),
    "space/test_implicit_steps.py": ("",),
    "space/test_law_parameters.py": ("",),
    "space/test_movable_in_space.py": ("slopes[all", "points[some"),
    "space/test_names_in_space.py": ("",),
    "space/test_orders_in_space.py": ("[gauss",),
    "space/test_windows.py": ("",),
    "stress/test_stress.py": ("alpha", "periods-", "turns-wheel", "turns-driven", "-slow-"),
    "test_packaging.py": ("older_one[False",),
    "variables/test_crush.py": (
        "alpha",
        "-compression]",
        "random_legs",
        "histories",
        "computed[ceases",
        "computed[on the flank",
        "computed[beyond the plateau, way back",
        "regime[second stroke, elastic-tension",
        "regime[second stroke, thrown off-tension",
        "regime[begins beyond, further in-tension",
        "regime[begins beyond, second stroke-tension",
        "regime[begins on the flank-tension",
    ),
    "variables/test_names.py": ("place_is_differentiated[True",),
    "variables/test_parameters.py": (
        "generalized_alpha",
        *(
            f"a_parameter_is_that_of_what_is_computed[{law}-jointed"
            for law in ("clipped", "cubic", "curve", "gap", "pulse", "actuator", "drawn", "formula", "expression")
        ),
    ),
    "variables/test_runs.py": ("the_catch",),
    "variables/test_settled.py": (
        "generalized_alpha",
        "agree[gap",
        "agree[cubic",
        "agree[actuator",
        "agree[pulse",
        "equilibrium[gap without",
        "equilibrium[gap out",
        "equilibrium[cubic",
        "equilibrium[pulse",
        "equilibrium[actuator]",
        "equilibrium[spring active at the start",
        "equilibrium[spring active later",
        "two_load_cases_and_what_is_crushed",
    ),
    "variables/test_shared.py": ("mirrored_halves",),
    "variables/test_stages.py": ("any_number_of_processes", "commands_tell_the_stages", "stopped_anywhere"),
}


class _Run:
    """What is run: `make test` sets this before tests are imported."""

    is_quick = False


def begin(config: pytest.Config) -> None:
    """Note whether thorough tests are left out."""
    _Run.is_quick = config.getoption("markexpr") == "not thorough"


def examples(quick: int, thorough: int) -> int:
    """How many random examples of a property are tried: by `make test`, and by `make test-all` or a test alone."""
    return quick if _Run.is_quick else thorough


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
