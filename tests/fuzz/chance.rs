//! Choices from a seed.

/// SplitMix64 (Steele, Lea, Flood, OOPSLA 2014).
pub struct Chance(pub u64);

impl Chance {
    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `end`; 0 where there is none.
    // below `end`
    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % end.max(1) as u64) as usize
    }

    /// A byte, every other one of those that mean something to a parser.
    // one byte is meant
    pub fn byte(&mut self) -> u8 {
        const TELLING: [u8; 16] = *b"\0\x01\x7f\x80\xff\r\n\"'-.=[]#9";
        if self.below(2) == 0 { TELLING[self.below(TELLING.len())] } else { self.bits() as u8 }
    }
}
