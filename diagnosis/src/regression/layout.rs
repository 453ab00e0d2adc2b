//! Where a hypothesis keeps what in its vector of coordinates: the baseline's parameters first, then each
//! effect's own, the size before the shapes. docs/diagnosis/model.md, section 2.

use crate::regression::Member;
use std::ops::Range;

/// Number of baseline parameters: logarithms of mu0, normal and lateral stiffness, the nuisances of every hypothesis.
pub const NUISANCES: usize = 3;

/// The places of all parameters of a hypothesis.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// Where each member's parameters begin; the end of the last one after them.
    starts: Vec<usize>,
}

impl Layout {
    /// The layout of a hypothesis with these members.
    pub fn of(members: &[Member]) -> Self {
        let mut starts = vec![NUISANCES];
        starts.extend(members.iter().scan(NUISANCES, |at, m| {
            *at += m.count();
            Some(*at)
        }));
        Layout { starts }
    }

    /// The parameters of a member.
    pub fn member(&self, index: usize) -> Range<usize> {
        self.starts[index]..self.starts[index + 1]
    }

    /// The size of a member.
    pub fn size(&self, index: usize) -> usize {
        self.starts[index]
    }

    /// The parameters of each member in turn.
    pub fn members(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        self.starts.windows(2).map(|w| w[0]..w[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nuisances, then each member's parameters without a gap, whatever their number.
    #[test]
    fn members_follow_the_nuisances_without_a_gap() {
        for effect in 0..effects::library().len() {
            let members = [Member { effect, law: 0 }, Member { effect: 0, law: 0 }];
            let layout = Layout::of(&members);
            let (first, second) = (layout.member(0), layout.member(1));
            assert_eq!(first, NUISANCES..NUISANCES + members[0].count());
            assert_eq!((second.start, second.len()), (first.end, members[1].count()));
            assert_eq!(layout.members().collect::<Vec<_>>(), [first, second]);
        }
        assert_eq!(Layout::of(&[]).members().count(), 0);
    }
}
