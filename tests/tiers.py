"""Which tests `make test` leaves out, for their time: they have the mark `thorough`; `make test-all` runs them, too.

What is listed here repeats a promise that a test among the others makes, with another integrator, method, law or scene;
is a whole application, or about benchmarks alone; is about what is rare, as a worker that dies; or compiles kernels
that few cases need. Of random examples of a property `make test` tries fewer (`examples`).
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
    "bench/test_bench.py": (
        "work_and_precision",
        "whole_run_is_measured",
    ),
    "bench/test_damage.py": ("lose_nothing",),
    "bench/test_hunt.py": ("",),
    "bench/test_hunt_space.py": ("",),
    "bench/test_optimum.py": ("rows[belts product", "rows[machine"),
    "bench/test_parts.py": ("",),
    "bench/test_peers.py": ("installed_peers", "jax_moves_as_ours"),
    "bench/test_peers_in_space.py": ("installed_peers",),
    "case/test_fuzz.py": ("place[2", "place[3", "place[1"),
    "case/test_schema.py": ("is_a_schema",),
    "cli/test_cli_commands.py": ("workers_end_when", "goes_on[2-", "optima_tell_the_command"),
    "cli/test_finalize.py": ("a_fixed_step_is_verified",),
    "cli/test_plot_export_new.py": ("starter_case_is_right", "to_the_byte[pdf", "is_drawn[gradient"),
    "cli/test_seeing.py": ("ctrl_c",),
    "cli/test_surroundings.py": (
        "No space left on device-schema",
        "2>&--2",
        "names_are_no_text",
        "folder_that_is_gone",
        "spelt[ascii",
        "spelt[latin",
        "Bad file descriptor-check a.yaml --json",
        "Bad file descriptor-schema",
        "No space left on device-check a.yaml]",
        "No space left on device---version",
    ),
    "compiler/test_cache_safety.py": (
        "full_disk",
        "damaged_files_of_the_cache",
    ),
    "compiler/test_machine_code.py": (
        "does_not_depend_on_what_was_compiled_before",
        "same_files_in_every_process",
        "functions_inside_entries_are_kept",
        "type_of_a_structure",
        "importing_numba[cases/fig6",
    ),
    "compiler/test_processors.py": ("",),
    "compiler/test_tried.py": (
        "[a compilation that goes wrong",
        "[a name that is missing",
        "[code that computes",
        "[machine code that asks",
        "[allocations with another header",
    ),
    "compiler/test_units.py": ("missing_or_damaged_of_it", "without_intermediate"),
    "compiler/test_vector.py": ("same_numbers[without AVX",),
    "distributions/test_brought.py": ("gradients_with_a_law", "a_resumed_one"),
    "docs/test_extending.py": ("worked_examples",),
    "docs/test_gallery.py": ("[vehicle", "[space-platform"),
    "docs/test_notebook.py": ("cells_run",),
    "docs/test_pages.py": ("blocks_of_a_page_hold",),
    "docs/test_results.py": ("every_dataset",),
    "docs/test_site.py": ("",),
    "engine/test_edges.py": ("finds_its_integrator",),
    "engine/test_error_estimate.py": (
        "methods_of_other_steps",
        "[generalized_alpha",
        "random_scenes[runge_kutta",
        "hundreds of periods-runge_kutta",
    ),
    "engine/test_golden.py": (
        "[fig6-motion",
        "[mooring",
        "[occupant",
        "[touchdown",
        "[restraint",
        "[tiedown",
        "[fig6-uncertain",
        "[lander",
    ),
    "engine/test_limits.py": ("narrow_pulse",),
    "engine/test_peaks.py": ("peak[7-", "peak[8-", "peak[9-", "peak[10-", "peak[11-"),
    "engine/test_reprs.py": ("mistake_for_type_checkers",),
    "engine/test_stiff_members.py": ("every_scale[lever",),
    "engine/test_trajectories.py": (
        "integrator[damped-gauss",
        "integrator[loads-runge_kutta",
        "integrator[kinks-gauss",
        "integrator[everything undamped",
        "integrator[everything-gauss",
        "integrator[several bodies",
    ),
    "engine/test_values_of_trajectories.py": ("evaluation[text4",),
    "fit/test_command.py": ("stopped_goes_on",),
    "fit/test_derivatives.py": ("loads_that_are_formulas",),
    "fit/test_fits.py": ("intervals_hold_the_truth", "many_more_motions"),
    "fit/test_in_space.py": ("",),
    "fit/test_seen.py": ("said_in_words",),
    "front/test_begun.py": ("killed_in_its_first_solve",),
    "front/test_cluster.py": ("dies_in_mid_sweep", "scheduler_that_dies", "a_sweep_runs_on"),
    "front/test_failures.py": ("beyond_a_constraint_are_off", "end_with_a_parent"),
    "front/test_fronts.py": (
        "ctrl_c",
        "21_points",
        "that_is_killed_goes_on",
        "three_objectives_make",
        "test_workers_change_nothing",
    ),
    "front/test_priced_fronts.py": ("points_are_optima", "a_stopped_front", "mirror_images", "runs_of_a_sweep"),
    "front/test_starts.py": (
        "with_several_starts_ends_the_same",
        "resumed_with_another_number",
        "workers_change_nothing",
    ),
    "general/test_across.py": ("peaks_time[alpha",),
    "general/test_against_springs.py": ("short_steps_give",),
    "general/test_brief_steps.py": ("[esdirk", "[generalized_alpha"),
    "general/test_bushing_damping.py": ("differences[generalized_alpha",),
    "general/test_candidate_prices.py": ("",),
    "general/test_contact.py": (
        "equation[0.0001-0.0001",
        "agree[solver1]",
        "equation[0.001-1e-08",
        "equation[0.0001-1e-12",
        "equation[0.0001-1e-06",
        "equation[0.0001-1e-08",
        "equation[0.0001-1e-10",
        "equation[1e-05",
        "generalized_alpha_comes",
    ),
    "general/test_crush.py": ("agree[solver1]", "return_mapping", "gradient_to_its_own_order"),
    "general/test_curve.py": (
        "a_step_has[0.1-1e-06",
        "tolerance[direct",
    ),
    "general/test_direct.py": ("alone[generalized_alpha",),
    "general/test_error_estimate.py": ("twenty[1e-05",),
    "general/test_esdirk.py": (
        "digits[",
        "damper_is_stiff",
        "stability_holds",
        "steps_for_integrals",
    ),
    "general/test_expression_laws.py": (
        "alpha",
        "in_space_are_slopes",
        "kinks_are_slopes[brown_mcphee",
        "kinks_are_slopes[hunt_crossley",
        "kinks_are_slopes[two_slopes",
        "kinks_are_slopes[length",
        "slopes[switched",
    ),
    "general/test_expression_responses.py": ("expressions[generalized_alpha",),
    "general/test_fewer_states.py": (
        "worth[curves",
        "worth[crushed legs in space",
        "looked_at[curves",
        "would_differ",
    ),
    "general/test_first_step.py": ("period_of_a_swing", "no_more_than_a_step_may", "same_at_every_scale"),
    "general/test_fixed_steps.py": ("near_its_switch_and_has_none",),
    "general/test_formulas_of_time.py": ("steps_of_collocation", "in_space_a_turn", "integral[wave"),
    "general/test_gauss_in_plane.py": ("tilted", "fourteen", "however_long", "explicit_or_implicit"),
    "general/test_gradients.py": (
        "agree[everything-",
        "computed[everything-generalized_alpha",
    ),
    "general/test_inerter.py": ("momentum[generalized_alpha",),
    "general/test_integrands.py": (
        "passes_zero[integral-adjoint",
        "passes_zero[mean-direct",
        "zero_are_those_of_the_values[0.3",
        "zero_are_those_of_the_values[0.03-direct",
        "passes_zero[mean-adjoint",
        "come_near_zero_are_those_of_the_values",
    ),
    "general/test_joints_in_motion.py": (
        "shares_the_load[generalized_alpha",
        "every_step[generalized_alpha",
        "period[generalized_alpha",
    ),
    "general/test_leading_members.py": ("found[300",),
    "general/test_methods.py": ("motions[generalized_alpha", "shorter_motions[runge"),
    "general/test_orders.py": ("fourth_order",),
    "general/test_peak_search.py": ("-alpha]", "peak[everything"),
    "general/test_projection.py": ("",),
    "general/test_row_sweep.py": ("-alpha]", "[everything-"),
    "general/test_sampled_roots.py": ("a_mean_of_what",),
    "general/test_settle.py": (
        "nothing_to_settle[1",
        "nothing_to_settle[2",
        "nothing_to_settle[3",
        "equilibrium[generalized_alpha",
    ),
    "general/test_settle_kinks.py": ("[1", "[2", "[3", "[5", "[6", "[7", "[8", "[9"),
    "general/test_since_settled.py": ("implicit",),
    "general/test_singular_poses.py": (
        "gradients_go_through_singular_poses[1e-06",
        "poses[1e-10",
        "poses[40",
        "poses[1e-08",
    ),
    "general/test_zero_length.py": (
        "named[generalized_alpha",
        "tolerance[1e-06-1e-06",
        "tolerance[1e-08-1e-06",
        "tolerance[0.0001",
    ),
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
        "may_turn[2-",
    ),
    "limiting/test_closed_forms.py": (
        "travel[x-max_abs-40.0",
        "base[0.07",
        "discretisation[t",
        "slanting",
        "too_short",
        "gravity_and_loads",
        "travel[norm",
        "read_backwards",
        "share_the_work[0.7",
    ),
    "mechanics/test_grids.py": ("[iterative", "[70-32-generalized", "[5-256-generalized"),
    "mechanics/test_joints.py": (
        "acceleration_rows[fixed",
        "acceleration_rows[distance",
        "acceleration_rows[prismatic",
    ),
    "optimizer/test_competing.py": ("optimum[False-1", "optimum[False-2", "optimum[True-1", "optimum[True-2"),
    "optimizer/test_conic.py": ("steps[300", "down[300"),
    "optimizer/test_many_forces.py": ("",),
    "optimizer/test_wide.py": (
        "shifts[2.0-12000",
        "shifts[0.05-12000",
        "do[1020",
        "do[8197",
        "shifts[0.2-12000",
        "goes[21",
        "goes[20-options2",
        "goes[20-options3",
    ),
    "optimizer/test_wide_rows.py": ("under_two_limits", "goes_on_to_the_bit"),
    "plan/test_plan.py": ("weigh_a_sum[nc", "weigh_a_sum[nbi", "see_little"),
    "published/test_published.py": ("two_thousand_seconds", "hundred_periods"),
    "robust/test_constraints.py": ("other_kernels_than",),
    "robust/test_gradients.py": ("better[max-", "the_sample[quantile", "the_sample[worst"),
    "robust/test_runs.py": (
        "several_points_end",
        "no_worker_survives",
        "cannot_be_computed_is_told",
        "imports_nothing_of_this",
        "gradient_compares",
        "{measure: mean_deviation",
        "{measure: quantile",
        "{measure: worst",
        "several_starts_on",
        "share_of_a_worker",
        "fronts_of_uncertain",
        "agrees_with_a_fresh_sample",
        "fresh_sample_agrees",
        "stopped_goes_on",
    ),
    "sensitivity/test_agreement.py": ("generalized_alpha",),
    "sensitivity/test_candidate_prices.py": ("[runge_kutta", "[generalized_alpha"),
    "session/test_combined_runs.py": ("share_one_utopia",),
    "session/test_near_zero.py": (
        "helps[mean",
        "helps[rms",
    ),
    "session/test_priced_candidates.py": (
        "all_candidates_built_none",
        "bit[20",
        "bit[45",
        "members_with_slack",
        "several_starts",
        "its_own_kernels",
        "whatever_the_case",
        "mirror_images_are_priced",
    ),
    "session/test_runs_and_files.py": (
        "after_the_iteration[2",
        "no_worker_survives",
        "whose_worker_dies",
        "workers_stop_when",
    ),
    "session/test_size_search.py": (
        "best_of_all_choices[2",
        "best_of_all_choices[3",
        "best_of_all_choices[4",
        "last_neighbours",
    ),
    "session/test_sizes.py": (
        "evaluations_too[[0, 0.4",
        "stopped_choice",
        "least_size[branch",
        "choices[branch",
        "poor_one_goes_on_where_it_was_stopped[40",
        "poor_one_goes_on_where_it_was_stopped[150",
    ),
    "session/test_starts_in_quotas.py": (
        "takes_over_the_first",
        "beginning[9-1",
        "been[30",
        "been[45",
        "been[70",
        "been[125",
        "been[150",
        "beginning[1-2",
        "beginning[1-9",
        "beginning[4-",
        "beginning[9-None",
        "been[100",
        "beginning[9-15",
    ),
    "space/test_bushings.py": ("slopes[",),
    "space/test_contacts_in_space.py": ("implicit", "collision", "gradients_through_contacts"),
    "space/test_driven_bodies.py": (
        "gradients_with_driven",
        "half_a_turn_in_a_step[628",
        "pulled_by_a_driven",
        "half_a_turn_in_a_step[150",
    ),
    "space/test_files.py": ("have_pictures_and_a_page",),
    "space/test_free_motions.py": ("settles_with_its_heading",),
    "space/test_gauss_in_space.py": ("windows", "gradient", "slopes", "tilted", "energy", "thousands"),
    "space/test_gradients.py": ("springs_alone", "direct"),
    "space/test_gradients_in_space.py": ("",),
    "space/test_grids_of_springs.py": ("over_very_many_springs", "without_the_kernels", "gauss"),
    "space/test_half_turns_looked_at.py": ("without_an_error_estimate", "a_rotation_at_the_end"),
    "space/test_implicit_steps.py": ("",),
    "space/test_kept_poses.py": ("",),
    "space/test_law_parameters.py": ("",),
    "space/test_movable_in_space.py": ("slopes[all", "points[some", "direct_agrees"),
    "space/test_names_in_space.py": ("",),
    "space/test_orders_in_space.py": ("[gauss",),
    "space/test_pictures.py": ("perspective[of two", "long_scene_stays", "perspective[of the design"),
    "space/test_starts.py": ("has_settled_stays",),
    "space/test_windows.py": ("",),
    "stress/test_stress.py": (
        "alpha",
        "periods-",
        "turns-wheel",
        "turns-driven",
        "-slow-",
        "turns-circle-gauss",
        "flywheel-runge-kutta-mean",
        "miss-1e-4",
        "miss-1e-6",
        "masses-pendulums",
    ),
    "test_packaging.py": (
        "of_other_sources",
        "older_one[False",
    ),
    "variables/test_crush.py": (
        "along_random_directions",
        "alpha",
        "-compression]",
        "random_legs",
        "histories",
        "computed[ceases",
        "computed[on the flank",
        "computed[beyond the plateau, way back",
        "regime[second stroke, elastic-tension",
        "regime[begins beyond, further in-tension",
        "regime[begins beyond, second stroke-tension",
        "regime[begins on the flank-tension",
        "long before-given0",
        "thrown off",
        "on the way back-tension",
        "regime[elastic",
        "begins beyond, way back",
        "second stroke, crushing",
    ),
    "variables/test_movable.py": (
        "every_law_are_differences[clipped",
        "every_law_are_differences[cubic",
        "every_law_are_differences[pulse",
        "every_law_are_differences[drawn",
        "every_law_are_differences[formula",
        "every_law_are_differences[expression",
        "are_those_of_fixed_steps",
    ),
    "variables/test_names.py": ("goes_on_to_the_bit", "place_is_differentiated[True", "beside_names_that"),
    "variables/test_parameters.py": (
        "generalized_alpha",
        *(
            f"a_parameter_is_that_of_what_is_computed[{law}-jointed"
            for law in ("clipped", "cubic", "curve", "gap", "pulse", "actuator", "drawn", "formula", "expression")
        ),
    ),
    "variables/test_runs.py": ("the_catch",),
    "variables/test_settled.py": (
        "equilibrium[gap in",
        "equilibrium[curve",
        "generalized_alpha",
        "agree[gap",
        "agree[cubic",
        "agree[actuator",
        "agree[pulse",
        "equilibrium[gap without",
        "equilibrium[gap out",
        "equilibrium[cubic",
        "equilibrium[pulse",
        "equilibrium[spring active at the start",
        "equilibrium[spring active later",
        "two_load_cases_and_what_is_crushed",
        "equilibrium[actuator",
        "equilibrium[table",
        "equilibrium[inerter",
    ),
    "variables/test_shared.py": ("mirrored_halves",),
    "variables/test_stages.py": ("any_number_of_processes", "commands_tell_the_stages", "stopped_anywhere"),
    "workers/test_worker_pool.py": ("are_not[2",),
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
