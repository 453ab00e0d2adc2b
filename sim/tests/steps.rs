//! A stepping world allocates nothing, and this crate uses no friction law of the project's.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use models::PeakToPeak;
use muprime_sim::amplifier::AmplifierInput;
use muprime_sim::stage::StageInput;
use muprime_sim::virtual_rig::VirtualRig;
use muprime_sim::world::WorldConfig;
use realtime::ports::{Amplifier, ForceSensor, Nanos, Stage};

struct Counting;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call is handed on unchanged to the system's allocator; counting touches a thread-local cell only.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promises are handed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are handed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_hundred_thousand_cycles_allocate_nothing() {
    for config in [WorldConfig::ideal(), WorldConfig::bundled()] {
        let mut rig = VirtualRig::new(&config, 1).unwrap();
        let before = COUNT.with(Cell::get);
        for ms in 0..100_000_u64 {
            let now = Nanos(ms * 1_000_000);
            let _ =
                (rig.read(now), Amplifier::state(&mut rig, now).is_ok(), Stage::state(&mut rig, now).is_ok());
            let amplitude = PeakToPeak::from_metres(1e-6 * (ms / 5000 % 4) as f64);
            let (frequency_hz, heartbeat) = (27_500.0, ms as u32);
            rig.world.command_amplifier(AmplifierInput { amplitude, frequency_hz, enable: true, heartbeat });
            let velocity_m_s = if ms / 1000 % 2 == 0 { 0.02 } else { -0.02 };
            rig.world.command_stage(StageInput { velocity_m_s, normal_force_n: 0.25 });
        }
        assert_eq!(COUNT.with(Cell::get) - before, 0);
    }
}

#[test]
fn no_law_of_the_project_is_used_here() {
    fn read(folder: &std::path::Path, found: &mut Vec<String>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                read(&path, found);
            } else {
                let text = std::fs::read_to_string(&path).unwrap();
                let laws = [
                    "models::spring_slider",
                    "models::psi",
                    "models::prediction",
                    "models::ridge",
                    "effects::",
                ];
                found.extend(
                    laws.iter().filter(|law| text.contains(**law)).map(|law| format!("{path:?}: {law}")),
                );
            }
        }
    }
    let mut found = Vec::new();
    read(&std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut found);
    assert!(found.is_empty(), "{found:?}");
}
