//! The rows of the fault list that the bench does not hold, and the tests that strike them.

macro_rules! elsewhere {
    ($($number:literal $fault:literal: $($file:literal $test:ident),+;)*) => {
        /// Rows of the fault list that strike what this bench does not hold (threads, files, the network):
        /// the tests that strike them. Number, fault, tests (a file of the workspace and a test in it).
        pub const ELSEWHERE: &[(u32, &str, &[(&str, &str)])] = &[
            $(($number, $fault, &[$(($file, stringify!($test))),+]),)*
        ];
    };
}

elsewhere! {
    12 "a late reply after a timeout":
        "tests/wall/wire/modbus_tcp.rs" no_prank_ever_becomes_a_force,
        "tests/peers/wire/lines.rs" no_prank_on_an_rtu_line_becomes_a_force;
    13 "wrong register type, word order, unit, scale":
        "tests/wall/wire/modbus_tcp.rs" swapped_words_are_refused_at_connection,
        "tests/wall/wire/modbus_tcp.rs" another_instrument_is_refused_before_anything_is_commanded;
    15 "corruption that passes its check":
        "tests/peers/wire/lines.rs" no_prank_on_an_rtu_line_becomes_a_force;
    16 "CAN bus-off":
        "tests/wall/can_kernel.rs" bus_off_ends_the_link_and_nothing_restarts_by_itself,
        "tests/wall/can_kernel.rs" no_command_from_before_a_bus_off_leaves_after_it;
    17 "CAN warning, passive":
        "drivers/src/can.rs" a_controller_that_warns_is_noted_and_a_passive_one_ends_the_link,
        "drivers/src/socketcan.rs" error_frames_are_classified,
        "tests/wall/can_kernel.rs" a_warning_is_noted_and_a_passive_controller_ends_the_link;
    19 "frame flood":
        "drivers/src/can.rs" a_full_bus_neither_hides_the_sensor_nor_its_silence,
        "drivers/src/canopen.rs" a_full_bus_does_not_hold_up_an_off,
        "tests/wall/can_kernel.rs" a_bus_full_of_others_frames_holds_nothing_up;
    21 "wall-clock jump":
        "tests/wall/wire_faults.rs" a_jump_of_the_wall_clock_trips_nothing_and_stamps_nothing_wrong;
    23 "the process stopped, the port blocked":
        "realtime/src/pacing/thread/tests.rs" a_process_that_was_stopped_trips_first_thing,
        "realtime/src/pacing/thread/tests.rs" a_blocked_port_is_lateness_overruns_and_a_trip,
        "tests/wall/wire_faults.rs" a_stopped_controller_is_outlived_by_the_amplifiers_watchdog_and_trips_when_it_goes_on;
    25 "panic of the loop":
        "realtime/src/pacing/thread/tests.rs" a_port_that_panics_ends_the_loop_with_the_drive_off;
    26 "slow recorder, full ring":
        "realtime/src/pacing/thread/tests.rs" a_full_ring_is_counted_and_holds_nothing_up;
    27 "disk full, read-only":
        "tests/wall/disk.rs" a_disk_that_fails_stops_the_sweep_in_order_and_keeps_what_was_measured,
        "tests/peers/crash.rs" a_read_only_folder_is_refused_before_anything_moves;
    28 "kill -9":
        "tests/wall/kills.rs" killed_at_any_instant_nothing_acknowledged_is_lost_and_the_drive_drops;
    29 "signals":
        "tests/wall/session.rs" an_interrupt_stops_safely_and_keeps_what_was_measured,
        "realtime/src/pacing/thread/tests.rs" a_stop_is_off_within_two_cycles_however_full_the_queue;
    30 "power cut":
        "tests/peers/power.rs" a_power_cut_at_any_instant_loses_nothing_that_was_acknowledged,
        "tests/record.rs" a_short_record_cut_at_every_byte_is_read_up_to_the_cut_and_recovered,
        "tests/record.rs" one_flipped_bit_anywhere_is_said_and_costs_one_chunk_at_most;
    41 "errors in a setup or plan":
        "tests/session.rs" bad_input_is_refused_with_its_place_and_nothing_is_touched,
        "tests/fuzz.rs" setups_plans_models_and_certificates,
        "realtime/src/safety/tests/bounds.rs" every_range_is_closed_at_both_ends;
    42 "certificates that do not hold":
        "tests/fuzz.rs" certificates;
    43 "slow model":
        "tests/realtime.rs" what_is_decided_leaves_before_the_model_is_asked;
    44 "two controllers":
        "tests/wall/session.rs" two_controllers_never_share_a_run;
    45 "cross-site requests":
        "tests/peers/dashboard.rs" an_attacker_gets_nothing;
    46 "floods":
        "tests/wall/wire/modbus_tcp.rs" more_clients_than_allowed_are_turned_away_and_a_place_is_freed,
        "tests/peers/dashboard.rs" an_attacker_gets_nothing,
        "tests/peers/dashboard.rs" viewers_that_do_not_read_hold_nobody_up;
    49 "markup in names":
        "runs/src/report/html.rs" markup_and_terminal_escapes_in_names_are_harmless;
    50 "a crash at every step":
        "tests/peers/crash.rs" a_crash_at_every_step_of_a_sweep_loses_and_doubles_nothing;
    53 "a stall before or during arming":
        "runs/src/sweep/arming/tests.rs" a_stall_before_arming_is_reported_and_the_second_channel_proved,
        "runs/src/sweep/arming/tests.rs" a_proof_that_a_stall_broke_off_is_made_again_and_told,
        "runs/src/sweep/arming/tests.rs" a_stop_that_was_pressed_before_arming_is_not_cleared_by_the_sweep,
        "runs/src/sweep/arming/tests.rs" a_fault_of_the_amplifiers_own_is_its_own_beside_a_stall_too;
}
