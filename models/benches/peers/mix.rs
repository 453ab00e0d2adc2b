//! The bound that the kernel's own instructions set: its loops are found in the disassembly of the running program, their
//! instructions counted by the unit that carries them out, and the busiest unit says how many cycles an update takes at least.
#![allow(dead_code, reason = "included by several programs")]

use std::collections::BTreeSet;
use std::process::Command;

/// Instructions of one round of a loop, one vector of values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Mix {
    /// All, a compare and its jump counted once.
    pub all: usize,
    /// Multiplications and multiply-adds.
    pub multiply: usize,
    /// Additions, subtractions, minima.
    pub add: usize,
    /// Divisions.
    pub divide: usize,
    /// Bitwise operations (changes of sign).
    pub logic: usize,
    /// Vectors read; and other words (pointers that did not fit the registers).
    pub load: usize,
    pub load_word: usize,
    /// Vectors written.
    pub store: usize,
}

/// What a core does in a cycle.
#[derive(Clone, Copy, Debug)]
pub struct Core {
    pub name: &'static str,
    /// Vectors a cycle, of the width in question: multiply, add, and all floating-point and logic together.
    multiply: f64,
    add: f64,
    vector: f64,
    /// Whether additions share the units of multiplications.
    shared: bool,
    load: f64,
    store: f64,
    /// Cycles that a division keeps a multiplier.
    divide: f64,
    /// Instructions a cycle.
    front: f64,
}

impl Core {
    /// Zen 4: pipes 0 and 1 multiply, 2 and 3 add, all of 256 bits, so that 512 bits take a pipe twice; two loads of 256 bits or
    /// one of 512, one store of 256 bits or half a one of 512; six instructions. (AMD, Software optimization guide for the Zen4
    /// microarchitecture, publication 57647; division from uops.info.)
    pub fn zen4(avx512: bool) -> Core {
        let half = if avx512 { 0.5 } else { 1.0 };
        Core {
            name: "Zen 4",
            multiply: 2.0 * half,
            add: 2.0 * half,
            vector: 4.0 * half,
            shared: false,
            load: 2.0 * half,
            store: half,
            divide: 5.0 / half,
            front: 6.0,
        }
    }

    /// Ice Lake and later Xeons with two AVX-512 multipliers: ports 0 and 5 do all arithmetic of 512 bits,
    /// ports 0 and 1 that of 256 (logic also on 5); two loads of either, two stores of 256 bits or one of
    /// 512; five instructions. (Intel, Optimization reference manual, 248966; division from uops.info.)
    pub fn xeon(avx512: bool) -> Core {
        Core {
            name: "Xeon (Ice Lake)",
            multiply: 2.0,
            add: 2.0,
            vector: if avx512 { 2.0 } else { 3.0 },
            shared: true,
            load: 2.0,
            store: if avx512 { 1.0 } else { 2.0 },
            divide: if avx512 { 16.0 } else { 8.0 },
            front: 5.0,
        }
    }

    /// Least cycles of a round, and the unit that sets them.
    pub fn cycles(&self, mix: &Mix) -> (f64, &'static str) {
        let (multiply, add) = (mix.multiply as f64, mix.add as f64);
        let dividing = mix.divide as f64 * self.divide;
        let arithmetic = if self.shared { multiply + add } else { multiply };
        [
            (arithmetic / self.multiply + dividing / 2.0, "multipliers"),
            (add / self.add, "adders"),
            ((multiply + add + mix.logic as f64) / self.vector, "vector units"),
            (mix.load as f64 / self.load, "loads"),
            (mix.store as f64 / self.store, "stores"),
            (mix.all as f64 / self.front, "front end"),
        ]
        .into_iter()
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .expect("six units")
    }
}

/// The loops of the kernel.
#[derive(Clone, Copy, Debug)]
pub struct Loops {
    pub small: Mix,
    pub objective: Mix,
    pub nodes: Mix,
}

/// Finds them in this program, for vectors of 512 or 256 bits; none without objdump, or where the compiler
/// laid them out so that they are not known again.
pub fn loops(avx512: bool) -> Option<Loops> {
    let program = std::env::current_exe().ok()?;
    let out = Command::new("objdump").args(["-d", "--no-show-raw-insn"]).arg(program).output().ok()?;
    let text = String::from_utf8_lossy(&out.stdout);
    let lines: Vec<(u64, &str)> = text
        .lines()
        .filter_map(|line| {
            let (address, code) = line.split_once(":\t")?;
            Some((u64::from_str_radix(address.trim(), 16).ok()?, code.trim()))
        })
        .collect();
    let wide = if avx512 { "%zmm" } else { "%ymm" };
    let mut found = BTreeSet::new();
    let mut last_jump = 0;
    for (end, (_, code)) in lines.iter().enumerate() {
        let Some(start) = backward(&lines, end, code) else { continue };
        // Innermost: no other jump back ends within it.
        if start > last_jump
            && let body = &lines[start..=end]
            && body.iter().filter(|(_, c)| c.contains(wide)).count() >= 20
        {
            found.insert(count(body.iter().map(|(_, c)| *c), wide));
        }
        last_jump = end;
    }
    // The element loops write their 5 stresses and 8 forces; the node loop 4 fields from 11. Viscous arms make them longer.
    let element = |divide: usize| {
        let of = found.iter().filter(|m| m.divide == divide && m.store >= 13 && m.multiply > 40);
        of.min_by_key(|m| m.all).copied()
    };
    let nodes =
        found.iter().filter(|m| m.store == 4 && m.load == 11 && m.multiply < 10).min_by_key(|m| m.all);
    Some(Loops { small: element(0)?, objective: element(1)?, nodes: *nodes? })
}

/// Where a conditional jump goes back to, as an index, if it does, and not far.
fn backward(lines: &[(u64, &str)], at: usize, code: &str) -> Option<usize> {
    let (jump, rest) = code.split_once(' ')?;
    if !jump.starts_with('j') || jump == "jmp" {
        return None;
    }
    let target = u64::from_str_radix(rest.split_whitespace().next()?, 16).ok()?;
    let start = lines[..at].binary_search_by_key(&target, |line| line.0).ok()?;
    (at - start < 400).then_some(start)
}

fn count<'a>(body: impl Iterator<Item = &'a str>, wide: &str) -> Mix {
    let mut mix = Mix::default();
    for code in body {
        mix.all += usize::from(!code.starts_with('j'));
        let name = code.split_whitespace().next().unwrap_or("");
        let vector = code.contains(wide);
        let memory = code.contains('(') && !name.starts_with("lea") && !name.starts_with("nop");
        let writes = memory && code.ends_with(')') && name.starts_with("vmov");
        match name {
            _ if !vector => {}
            n if n.starts_with("vf") || n.starts_with("vmul") => mix.multiply += 1,
            n if ["vadd", "vsub", "vmin", "vmax"].iter().any(|s| n.starts_with(s)) => mix.add += 1,
            n if n.starts_with("vdiv") => mix.divide += 1,
            n if n.starts_with("vxor") || n.starts_with("vpxor") => mix.logic += 1,
            _ => {}
        }
        if writes && vector {
            mix.store += 1;
        } else if memory && vector {
            mix.load += 1;
        } else if memory {
            mix.load_word += 1;
        }
    }
    mix
}
