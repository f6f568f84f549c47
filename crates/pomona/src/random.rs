//! Numbers that look random and are the same on every machine.

/// From one state of [`SplitMix`] to the next.
const STEP: u64 = 0x9E37_79B9_7F4A_7C15;

/// A fixed shuffle of 64-bit keys, the first number of [`SplitMix`] from each: what is tried first must not follow
/// the input's order.
pub(crate) fn shuffled(key: u64) -> u64 {
    let mut z = key.wrapping_add(STEP);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// `SplitMix64` (Steele, Lea and Flood, 2014).
pub(crate) struct SplitMix(pub u64);

impl SplitMix {
    fn next(&mut self) -> u64 {
        let number = shuffled(self.0);
        self.0 = self.0.wrapping_add(STEP);
        number
    }

    /// A number below `n`; the bias of n / 2^64 is nothing.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.next()) * n as u128) >> 64) as usize
    }

    /// Three different numbers below `n >= 3`.
    pub(crate) fn three(&mut self, n: usize) -> [usize; 3] {
        loop {
            let [a, b, c] = std::array::from_fn(|_| self.below(n));
            if a != b && b != c && c != a {
                return [a, b, c];
            }
        }
    }
}
