//! A compiled model makes nothing in the loop: its first prediction already allocates nothing. Alone in its
//! process, for tables are made once in each.

use models::Condition;
use muprime_effects::corrected::{Corrected, SavedModel};
use muprime_effects::operating::{Baseline, Design};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};

static ALLOCATED: AtomicU64 = AtomicU64::new(0);

struct Counting;

// SAFETY: every call is passed to the system's allocator unchanged; counting touches an atomic number only.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATED.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn the_first_prediction_of_a_compiled_model_allocates_nothing() {
    let saved = SavedModel {
        schema: "muprime.model/1".into(),
        verdict: "no_gap".into(),
        relative_sd: 0.01,
        interpolation_error: 0.0,
        baseline: Baseline { mu0: 0.5, normal_stiffness_n_per_m: 3.9e6, lateral_stiffness_n_per_m: 1.5e6 },
        design: Design {
            duration_s: 100.0,
            reference_load_n: 0.3,
            reference_speed_m_s: 0.02,
            reference_frequency_hz: 27.5e3,
            reference_temperature_c: 22.0,
            stroke_m: 0.02,
            largest_amplitude_m: 3e-6,
        },
        law: None,
        effects: Vec::new(),
    };
    let model = Corrected::compile_on(&saved, None).unwrap();
    let before = ALLOCATED.load(Ordering::Relaxed);
    let force = model.lateral_force(&Condition::paper());
    let made = ALLOCATED.load(Ordering::Relaxed) - before;
    assert!(force.is_finite() && made == 0, "{made} allocations");
}
