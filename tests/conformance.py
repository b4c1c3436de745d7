"""The conformance table: features of FMI 2.0 and 3.0, the FMUs that exercise them, and their tests.

    python -m tests.conformance         prints it as Markdown, for tests/README.md

`test_conformance.py` asserts that the tests exist, run in the ordinary suite, and that
tests/README.md has this very table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

PASS, NONE = "pass", "–"

#: sources of the FMUs: name -> file and contents
FMUS = {
    "ours": ("fmus/export/fmu.py", "exported plants and blocks of this project"),
    "probe": ("tests/cosim/fmi/c/probe.h", "C; all types, events, arrays, structural parameters"),
    "ball": ("tests/cosim/fmi/c/ball2.c", "C; Model Exchange with state and time events, failures on demand"),
    "metronome": (
        "tests/cosim/fmi/c/metronome.c",
        "C; FMI 3.0 Co-Simulation with event mode, clocks, strings, binary data",
    ),
    "pythonfmu": ("tests/others.py", "made by pythonfmu 0.7 (FMI 2.0) and pythonfmu3 0.3 (FMI 3.0)"),
    "crash": ("tests/cosim/fmi/c/crash.c", "C; ends its process in any call"),
    "bad": ("tests/cosim/fmi/c/bad.c", "C; without faults, or with one that the doctor looks for"),
    "broken": ("tests/cosim/fmi/file/test_archive.py", "damaged and hostile archives and descriptions"),
}


@dataclass(frozen=True)
class Row:
    """A feature; `fmi2` and `fmi3` are PASS, NONE (not in that version) or "no", with a reason in `note`."""

    feature: str
    fmi2: str
    fmi3: str
    fmus: str
    tests: Sequence[str]
    note: str = ""


def both(feature: str, fmus: str, *tests: str, note: str = "") -> Row:
    return Row(feature, PASS, PASS, fmus, tests, note)


def only3(feature: str, fmus: str, *tests: str, note: str = "") -> Row:
    return Row(feature, NONE, PASS, fmus, tests, note)


F3, ME = "cosim/fmi/test_fmi3.py", "cosim/fmi/instance/test_model_exchange.py"
EVENTS, STATES = "cosim/fmi/instance/test_co_simulation_events.py", "cosim/run/test_simulation.py"

ISOLATED, EXAMPLES = "cosim/fmi/isolation/test_isolation.py", "scenarios/test_examples.py"
UNITS, DOCTOR = "cosim/fmi/file/test_display_units.py", "cosim/doctor/test_examination.py"

TABLE: dict[str, list[Row]] = {
    "In": [
        both("Co-Simulation", "probe, ours", f"{F3}::test_hand_written_fmus_are_valid_and_run_in_fmpy"),
        both(
            "plants exported by other tools",
            "pythonfmu",
            f"{EXAMPLES}::test_a_controller_on_somebody_elses_plant",
        ),
        both(
            "tool coupling; an error names a missing tool",
            "pythonfmu, metronome",
            f"{EXAMPLES}::test_a_controller_on_somebody_elses_plant",
            "cosim/fmi/test_loading.py::test_an_fmu_that_needs_its_tool_says_so",
        ),
        both(
            "Model Exchange, ode1 to ode4 in the compiled loop",
            "ours",
            "test_conformance.py::test_model_exchange_of_both_versions",
            f"{ME}::test_order_of_convergence",
        ),
        both(
            "Model Exchange, CVODE for stiff plants",
            "ours",
            "test_conformance.py::test_model_exchange_of_both_versions",
            f"{ME}::test_a_stiff_plant_with_held_inputs",
        ),
        both(
            "state, time and step events",
            "probe, ball",
            f"{F3}::test_state_time_and_step_events",
            f"{ME}::test_a_bouncing_ball_against_its_closed_form",
            f"{ME}::test_time_events_are_met_exactly",
        ),
        both(
            "real, integer, boolean, enumeration variables in and out",
            "probe",
            f"{F3}::test_every_type_goes_in_and_out",
        ),
        only3(
            "Float32, Int8 to UInt64 to their limits",
            "probe",
            f"{F3}::test_numbers_of_all_widths_at_their_limits",
        ),
        both(
            "strings, as start values and from FMU to FMU",
            "probe, metronome",
            f"{F3}::test_units_strings_and_dependencies",
            "cosim/system/test_strings_and_binary.py::test_texts_of_both_versions",
        ),
        only3(
            "binary data, as start values and from FMU to FMU",
            "probe, metronome",
            f"{F3}::test_binary_start_values",
            "cosim/system/test_strings_and_binary.py::test_texts_go_from_fmu_to_fmu",
        ),
        only3(
            "arrays as ports with shapes; structural parameters in configuration mode",
            "probe",
            f"{F3}::test_structural_parameters_size_arrays",
        ),
        only3(
            "early return",
            "probe, metronome",
            f"{F3}::test_an_early_return_is_continued",
            f"{EVENTS}::test_events_inside_steps",
        ),
        only3("event mode in Co-Simulation", "metronome", f"{EVENTS}::test_events_inside_steps"),
        only3(
            "clocks, periodic and triggered, in and out",
            "metronome",
            "cosim/fmi/test_clocks.py::test_periodic_clocks",
            "cosim/fmi/test_clocks.py::test_a_triggered_input_clock_ticks_when_it_is_not_0",
            "cosim/fmi/test_clocks.py::test_an_output_clock_reads_1_when_it_has_ticked_since_the_last_point",
            note="Co-Simulation",
        ),
        both(
            "an FMU requests the end of the run",
            "probe, ball",
            f"{F3}::test_a_request_to_end_ends_the_run",
            f"{ME}::test_a_request_to_end_in_an_event",
        ),
        both("one instance per process", "probe", f"{F3}::test_an_fmu_with_one_instance_per_process"),
        both(
            "instances of one FMU share an extraction",
            "ours",
            "cosim/fmi/file/test_archive.py::test_fmus_of_one_file_share_a_folder_while_there_is_one",
        ),
        both(
            "start values and parameters by name",
            "ours, probe",
            "cosim/fmi/test_fmu.py::test_start_values_of_parameters_and_of_unconnected_inputs",
            f"{F3}::test_units_strings_and_dependencies",
        ),
        both(
            "units, converted on connections",
            "probe",
            f"{F3}::test_units_strings_and_dependencies",
            "cosim/system/test_system.py::test_units_are_converted",
        ),
        both(
            "display units; start values with units",
            "probe",
            f"{UNITS}::test_start_values_with_units",
            f"{UNITS}::test_inspection_shows_display_units",
        ),
        only3("aliases", "probe", f"{F3}::test_aliases_are_names_of_one_variable"),
        both(
            "dependencies: a missing attribute means all, an empty one none",
            "probe",
            f"{F3}::test_units_strings_and_dependencies",
        ),
        both(
            "get, set and serialise state: snapshot, restore, branch; an error names an FMU without states",
            "ours, probe",
            f"{STATES}::test_a_snapshot_is_returned_to_exactly_and_a_branch_goes_its_own_way",
            f"{STATES}::test_components_that_cannot_keep_their_state_are_named",
        ),
        both(
            "an FMU in the place of a block", "ours", f"{F3}::test_a_block_as_fmu_acts_where_the_block_acts"
        ),
        both(
            "damaged and hostile archives are an error",
            "broken",
            "cosim/fmi/file/test_archive.py::test_a_path_out_of_the_folder",
            "cosim/fmi/file/test_fuzzed_fmu.py::test_changed_archives",
        ),
        Row("Scheduled Execution", NONE, "no", "", [], "a master with fixed steps has no scheduler to offer"),
        Row(
            "the FMI project's Reference FMUs, in the tests",
            "no",
            "no",
            "",
            [],
            "not available here; seven of them, rebuilt from the published sources, give their references: "
            "Co-Simulation to rounding, Model Exchange within the accuracy of the references",
        ),
    ],
    "Out": [
        both(
            "every block and plant; no finding of FMPy and fmutool; the same bits in the project's own loop",
            "ours",
            "fmus/export/test_every_class.py::test_every_class_can_be_made",
            "fmus/export/test_every_class.py::test_a_class_leaves",
            note="versions in turn; each class in both under the marker `long`",
        ),
        both(
            "controllers and plants close the loop in FMPy",
            "ours",
            "fmus/export/test_controllers_elsewhere.py::test_a_loop_of_fmpys_calls_closes_the_loop",
        ),
        both(
            "and in ecos",
            "ours",
            "fmus/export/test_controllers_elsewhere.py::test_ecos_closes_the_loop",
            note="FMI 3.0: scalars, ecos has no arrays",
        ),
        only3(
            "arrays as arrays",
            "ours",
            "fmus/export/test_fmi3.py::test_arrays_are_arrays",
            "fmus/export/test_fmi3.py::test_values_go_in_and_out_as_arrays",
        ),
        both(
            "Co-Simulation with any step, Model Exchange",
            "ours",
            "fmus/export/test_trajectories.py::test_steps_of_any_length_are_exact",
            "fmus/export/test_trajectories.py::test_model_exchange_in_fmpy",
            "fmus/export/test_fmi3.py::test_model_exchange_in_fmpy",
        ),
        both(
            "state: get, set, serialise",
            "ours",
            "fmus/export/test_state.py::test_a_restored_state_continues_bit_for_bit",
            "fmus/export/test_fmi3.py::test_a_state_as_bytes_in_another_instance",
        ),
        both(
            "reset; many instances",
            "ours",
            "fmus/export/test_state.py::test_reset_repeats_the_run_bit_for_bit",
            "fmus/export/test_state.py::test_cycles_do_not_grow",
            "test_conformance.py::test_reset_and_many_instances",
        ),
        both(
            "directional derivatives",
            "ours",
            "fmus/export/test_trajectories.py::test_directional_derivatives_of_a_linear_plant",
            "fmus/export/test_fmi3.py::test_directional_derivatives_by_arrays",
        ),
        both(
            "dependencies, exact; units",
            "ours",
            "fmus/export/test_validity.py::test_dependencies_are_exact_by_element",
            "fmus/export/test_validity.py::test_every_variable_with_a_unit_has_it_defined_in_base_units",
            "test_conformance.py::test_the_structure_is_the_same_in_both_versions",
        ),
        both(
            "misuse is an error with a reason",
            "ours",
            "fmus/export/test_misuse.py::test_misuse_is_an_error_with_a_reason_and_changes_nothing",
            "fmus/export/test_fmi3.py::test_misuse_is_an_error_with_a_reason",
        ),
        both(
            "reference result (FMI-LS-REF)",
            "ours",
            "fmus/export/test_validity.py::test_the_reference_result_is_what_fmpy_simulates",
            "fmus/export/test_validity.py::test_both_versions_of_fmi_compute_the_same_bits",
        ),
        both(
            "for Linux and macOS from any machine",
            "ours",
            "fmus/export/test_link.py::test_linux",
            "fmus/export/test_link.py::test_macos_is_one_universal_library",
            "fmus/export/test_fmi3.py::test_every_platform_has_its_folder",
        ),
        both(
            "for Windows from any machine",
            "ours",
            "fmus/export/test_link.py::test_windows",
            note="`-m long`: the first link takes a minute",
        ),
        Row(
            "early return, event mode, clocks, strings",
            NONE,
            "no",
            "",
            [],
            "kernels have floats and no events inside a step",
        ),
    ],
    "Systems": [
        both(
            "SSP 1.0 and 2.0 out and in: connections, parameters, units",
            "ours",
            "fmus/packaging/test_ssp.py::test_the_same_bits_after_the_way_through_a_file",
            "cosim/ssp/test_ssp.py::test_values_come_from_files_through_mappings_and_prefixes",
        ),
        both(
            "a Python block in the place of a component",
            "ours",
            "fmus/packaging/test_ssp.py::test_a_python_block_in_place_of_a_component",
        ),
        Row(
            "an exported SSP in ecos, libcosim and FMPy",
            PASS,
            PASS,
            "ours",
            [
                "fmus/packaging/test_ssp_elsewhere.py::test_the_same_numbers_elsewhere",
                "fmus/packaging/test_ssp_elsewhere.py::test_fmus_of_version_3_in_ecos",
            ],
            "SSP 1.0; FMI 3.0 in ecos; these tools have no arrays",
        ),
        both(
            "a whole system as one FMU",
            "ours",
            "fmus/packaging/test_container.py::test_the_same_bits_as_the_system",
        ),
        both(
            "`cosim run loop.ssp`, with Python blocks named on the command line",
            "ours",
            "cosim/cli/test_ssp_scenario.py::test_a_file_runs_as_its_scenario_does",
            "cosim/cli/test_ssp_scenario.py::test_a_controller_from_the_command_line",
        ),
    ],
    "Strong coupling": [
        both(
            "force and motion by Newton, with rollback",
            "ours",
            "cosim/run/coupling/test_iterated.py::test_fmus_give_what_python_gives",
            "cosim/run/coupling/test_iterated.py::test_what_is_exchanged_agrees_at_every_communication_point",
        ),
        both(
            "the delay of plain coupling, measured",
            "ours",
            "cosim/run/coupling/test_iterated.py::test_the_delay_of_plain_coupling_is_of_first_order_and_iterated_coupling_of_second",
        ),
        both(
            "a coupling that does not converge ends the run with an error",
            "ours",
            "cosim/run/coupling/test_iterated.py::test_a_coupling_without_solution_ends_the_run_with_what_was_computed",
        ),
    ],
    "Doctor": [
        both("correct FMUs pass", "ours", f"{DOCTOR}::test_an_exported_fmu_has_nothing_above_a_note"),
        both(
            "each fault, crashes included, is found by its probe",
            "bad, probe, pythonfmu",
            f"{DOCTOR}::test_a_fault_is_found",
            f"{DOCTOR}::test_a_fault_that_ends_or_stops_the_process_is_found",
            "test_conformance.py::test_the_doctor_on_fmus_of_fmi_3_that_are_not_ours",
        ),
        both("report, `--json`, exit code of the worst finding", "bad", f"{DOCTOR}::test_the_command_line"),
    ],
    "Isolation": [
        both(
            "an FMU in a process of its own: the same bits",
            "ours, probe, pythonfmu",
            f"{ISOLATED}::test_an_exported_plant",
            f"{ISOLATED}::test_numbers_of_all_types_and_events",
            "test_conformance.py::test_a_plant_in_python_in_a_process_of_its_own",
        ),
        both(
            "a crash ends the run with name, time and signal, and keeps the computed results",
            "crash, ours",
            f"{ISOLATED}::test_a_crash_in_the_loop",
            f"{ISOLATED}::test_a_crash_in_model_exchange",
            "test_conformance.py::test_an_isolated_fmu_of_fmi_3_that_is_killed",
        ),
        both(
            "several instances of an FMU that a process can load only once",
            "probe",
            f"{ISOLATED}::test_several_instances_of_an_fmu_that_a_process_can_have_only_once",
            "test_conformance.py::test_isolated_instances_of_fmi_3_that_a_process_can_have_once_only",
        ),
        both("snapshot, restore, branch", "ours", f"{ISOLATED}::test_states_are_saved_restored_and_branched"),
    ],
    "Examples": [
        both(
            "`external_plant`: a controller on an FMU of another tool",
            "pythonfmu, ours",
            f"{EXAMPLES}::test_a_controller_on_somebody_elses_plant",
        ),
        Row(
            "`building_in_fmpy`: an exported building, run with FMPy alone",
            PASS,
            NONE,
            "ours",
            [f"{EXAMPLES}::test_a_building_in_somebody_elses_loop"],
        ),
        Row(
            "`controller_in_ssp`: an exported controller in an SSP, here and in ecos",
            PASS,
            NONE,
            "ours",
            [f"{EXAMPLES}::test_a_controller_in_an_ssp"],
        ),
    ],
}


def cited(row: Row) -> list[str]:
    """Return the tests of a row as pytest names them, from the project's folder."""
    return [f"tests/{name}" for name in row.tests]


def rows() -> list[Row]:
    return [row for group in TABLE.values() for row in group]


def markdown() -> str:
    """Return the table for tests/README.md, where links are relative to tests/."""
    lines = []
    for group, listed in TABLE.items():
        lines += [f"| **{group}** | FMI 2.0 | FMI 3.0 | FMU | test |", "|---|---|---|---|---|"]
        for row in listed:
            note = f" ({row.note})" if row.note else ""
            tests = ", ".join(
                f"[{name.partition('::')[2].removeprefix('test_')}]({name.partition('::')[0]})"
                for name in row.tests
            )
            lines.append(
                f"| {row.feature}{note} | {row.fmi2} | {row.fmi3} | {row.fmus or NONE} | {tests or NONE} |"
            )
        lines.append("")
    lines += [f"- `{name}`: [{place}](../{place}), {what}" for name, (place, what) in FMUS.items()]
    return "\n".join(lines)


if __name__ == "__main__":
    print(markdown())
