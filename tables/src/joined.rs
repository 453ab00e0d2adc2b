//! Several runs or tables of one rig as one table: a run, and the further passes that its verdict wants.

use models::Pass;
use runs::run_dir::sessions_in;
use std::path::Path;

/// A run or table among others.
pub struct JoinedTable {
    /// Its folder or file, as the user gave it.
    pub name: String,
    /// Its passes.
    pub passes: Vec<Pass>,
    /// When it began by its record, Unix time in s; none of a table.
    pub start_unix_s: Option<f64>,
}

/// When the run in a folder began, Unix time in s.
pub fn start_of(run: &Path) -> Option<f64> {
    sessions_in(run).ok()?.first().map(|first| first.start_unix_ns as f64 * 1e-9)
}

/// One table of all parts, in the order of their begin where every one has a record, else in the order given.
///
/// Each part is a run of its own (`run`: its name, then its own `run` if it has one). A part begins when its
/// record says, at the earliest when the one before it ends: virtual runs and tables follow without a pause.
/// Points are numbered on: those of the second part by the next power of ten (pass 7 is 107 or 1007). One
/// part stays as it is.
///
/// # Errors
/// The same passes twice.
pub fn joined(mut parts: Vec<JoinedTable>) -> miette::Result<Vec<Pass>> {
    if parts.len() == 1 {
        return Ok(parts.remove(0).passes);
    }
    for (k, part) in parts.iter().enumerate() {
        if let Some(same) = parts[..k].iter().find(|before| before.passes == part.passes) {
            let (name, same) = (&part.name, &same.name);
            miette::bail!(help = "give each run once", "{name} holds the same passes as {same}");
        }
    }
    if parts.iter().all(|p| p.start_unix_s.is_some()) {
        parts.sort_by(|a, b| a.start_unix_s.unwrap_or(0.0).total_cmp(&b.start_unix_s.unwrap_or(0.0)));
    }
    let last = parts.iter().flat_map(|p| &p.passes).map(|p| p.point).max().unwrap_or(0);
    let apart = 10_u64.saturating_pow(last.max(1).ilog10() + 1);
    let first_unix_s = parts.first().and_then(|p| p.start_unix_s);
    let (mut all, mut end_s) = (Vec::new(), f64::NEG_INFINITY);
    for (part, k) in parts.into_iter().zip(0_u64..) {
        let times = || part.passes.iter().map(|p| p.time_s);
        let begin_s = times().fold(f64::INFINITY, f64::min);
        let recorded_s = part.start_unix_s.zip(first_unix_s).map_or(0.0, |(own, first)| own - first);
        let shift_s = recorded_s.max(end_s - begin_s);
        end_s = end_s.max(shift_s + times().fold(f64::NEG_INFINITY, f64::max));
        all.extend(part.passes.into_iter().map(|p| Pass {
            point: p.point.saturating_add(k.saturating_mul(apart)),
            time_s: p.time_s + shift_s,
            run: Some(p.run.map_or_else(|| part.name.clone(), |run| format!("{}: {run}", part.name))),
            ..p
        }));
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use models::Condition;

    fn part(name: &str, start_unix_s: Option<f64>, times: [f64; 2]) -> JoinedTable {
        let pass = |k: u64, time_s| Pass::at(k, &Condition { time_s, ..Condition::paper() }, Some(0.1));
        JoinedTable { name: name.into(), start_unix_s, passes: vec![pass(7, times[0]), pass(12, times[1])] }
    }

    fn seen(parts: Vec<JoinedTable>) -> Vec<(String, u64, f64)> {
        joined(parts).unwrap().into_iter().map(|p| (p.run.unwrap_or_default(), p.point, p.time_s)).collect()
    }

    #[test]
    fn runs_lie_apart_in_time_as_their_records_say() {
        let (late, first) = (part("b", Some(4000.0), [0.5, 60.0]), part("a", Some(1000.0), [1.0, 50.0]));
        let of = |name: &str, point, time_s| (name.to_string(), point, time_s);
        let wanted = [of("a", 7, 1.0), of("a", 12, 50.0), of("b", 107, 3000.5), of("b", 112, 3060.0)];
        assert_eq!(seen(vec![late, first]), wanted);
    }

    /// A virtual run takes less than the time that it states; a table states none.
    #[test]
    fn what_would_overlap_follows() {
        let second = |start| part("b", start, [0.5, 60.0]);
        for starts in [(Some(1000.0), Some(1002.0)), (None, Some(5.0)), (None, None)] {
            let all = seen(vec![part("a", starts.0, [1.0, 50.0]), second(starts.1)]);
            assert_eq!((all[2].2, all[3].2), (50.0, 109.5), "{starts:?}");
        }
    }

    /// A run that has no pass yet takes no time from those around it.
    #[test]
    fn a_part_without_passes_changes_nothing() {
        let empty = JoinedTable { name: "c".into(), passes: Vec::new(), start_unix_s: None };
        let all = seen(vec![part("a", None, [1.0, 50.0]), empty, part("b", None, [0.5, 60.0])]);
        assert_eq!((all[2].1, all[2].2), (207, 50.0));
    }

    #[test]
    fn one_table_stays_as_it_is() {
        let alone = part("a", None, [1.0, 2.0]);
        let before = alone.passes.clone();
        assert_eq!(joined(vec![alone]).unwrap(), before);
    }
}
