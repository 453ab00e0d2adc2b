//! Files that grow line by line: what of them is whole after a crash or a power cut. An error is a line
//! that is damaged, and not by a torn end.

use crate::sweep::MeasuredPass;
use miette::IntoDiagnostic;
use models::pass::{self, Pass};

/// Bytes up to the last line end, and up to the one before it.
fn ends(bytes: &[u8]) -> (usize, usize) {
    let after_line = |bytes: &[u8]| bytes.iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
    let last = after_line(bytes);
    (last, after_line(&bytes[..last.saturating_sub(1)]))
}

/// What `read` makes of whole lines, and how many bytes they are. Every line was synced before the next was written, so only the
/// last can be torn: it has no end, or a disk that wrote its sectors out of order has left a hole in it.
fn whole<T>(bytes: &[u8], read: impl Fn(&[u8]) -> miette::Result<T>) -> miette::Result<(T, usize)> {
    let (last, before) = ends(bytes);
    match read(&bytes[..last]) {
        Ok(found) => Ok((found, last)),
        Err(_) if bytes[before..last].contains(&0) => Ok((read(&bytes[..before])?, before)),
        Err(why) => Err(why),
    }
}

/// The passes of a point table.
pub(super) fn whole_table(bytes: &[u8]) -> miette::Result<(Vec<Pass>, usize)> {
    whole(bytes, |bytes| pass::read_passes(bytes).into_diagnostic())
}

/// The passes of a journal.
pub(super) fn whole_passes(bytes: &[u8]) -> miette::Result<(Vec<MeasuredPass>, usize)> {
    let line = |(i, line): (usize, &[u8])| {
        serde_json::from_slice(line).map_err(|e| miette::miette!("line {}: {e}", i + 1))
    };
    whole(bytes, |bytes| bytes.split_inclusive(|b| *b == b'\n').enumerate().map(line).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(points: u64) -> Vec<u8> {
        let condition = models::condition::Condition::paper();
        let passes: Vec<Pass> = (0..points).map(|n| Pass::at(n, &condition, Some(-0.05))).collect();
        let mut bytes = Vec::new();
        pass::write_passes(&passes, &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn a_torn_end_is_left_out_and_damage_is_not_taken_for_one() {
        let (two, three) = (table(2), table(3));
        for cut in two.len()..three.len() {
            let (passes, whole) = whole_table(&three[..cut]).unwrap();
            assert_eq!((passes.len(), whole), (2, two.len()), "cut at {cut}");
            // Its size was written, its sectors were not: all of them, or the first.
            for hole in [two.len()..three.len(), two.len()..cut] {
                let mut holed = three.clone();
                holed[hole.clone()].fill(0);
                assert_eq!(
                    whole_table(&holed).unwrap().1,
                    if hole.is_empty() { three.len() } else { two.len() }
                );
            }
        }
        assert_eq!(whole_table(&three).unwrap(), (whole_table(&three).unwrap().0, three.len()));
        let mut wrong = three.clone();
        let sign = three.len() - 4;
        wrong[sign] = b'x';
        assert!(whole_table(&wrong).is_err(), "a line that was whole and is damaged is never dropped");
        let mut middle = three.clone();
        middle[two.len() - 4] = 0;
        assert!(whole_table(&middle).is_err(), "only the last line can be torn");
    }
}
