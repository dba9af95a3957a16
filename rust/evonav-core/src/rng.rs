//! Named random streams: a draw depends on a seed and on labels, never on the order in which
//! streams are used or on the number of workers.

/// A counter-based stream: the `n`-th draw is a function of (seed, labels, n).
#[derive(Debug, Clone)]
pub struct Stream {
    key: u64,
    counter: u64,
}

/// Mix the bits of a number: the finaliser of SplitMix64 (Steele, Lea & Flood, OOPSLA 2014).
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

impl Stream {
    /// Create the stream of `seed` and `labels`. Labels are distinguished by content and by
    /// position.
    pub fn new(seed: u64, labels: &[&str]) -> Self {
        let mut key = mix(seed.wrapping_add(GOLDEN));
        for label in labels {
            for byte in label.bytes().map(u64::from).chain([256]) {
                key = mix(key.wrapping_mul(0x0000_0100_0000_01b3) ^ byte);
            }
        }
        Self { key, counter: 0 }
    }

    /// Return the stream of a place within this one; it does not depend on what has been drawn from
    /// this one. Places are distinguished by their numbers and by how many numbers there are.
    pub fn at(&self, place: &[i64]) -> Self {
        // Labels mix bytes and 256; the sign bit keeps numbers apart from both.
        let step = |key: u64, number: u64| {
            mix(key.wrapping_mul(0x0000_0100_0000_01b3) ^ number ^ (1 << 63)).wrapping_add(GOLDEN)
        };
        let numbers = place.iter().map(|&number| number as u64).chain([place.len() as u64]);
        Self { key: numbers.fold(self.key, step), counter: 0 }
    }

    /// Draw 64 bits.
    pub fn next_u64(&mut self) -> u64 {
        self.counter = self.counter.wrapping_add(1);
        mix(self.key.wrapping_add(self.counter.wrapping_mul(GOLDEN)))
    }

    /// Draw a uniform number in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * 2.0_f64.powi(-53)
    }

    /// Draw a standard normal number (Box & Muller 1958); takes two uniform draws.
    pub fn normal(&mut self) -> f64 {
        // 1 - u is never 0.
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// Draw a uniform integer in `0..bound`; 0 for an empty range.
    pub fn below(&mut self, bound: usize) -> usize {
        // Multiply-shift; the bias is below bound / 2^64.
        ((u128::from(self.next_u64()) * bound as u128) >> 64) as usize
    }

    /// Draw an index in proportion to `weights`; negative and non-finite weights count as 0. `None`
    /// if all are 0.
    pub fn choose_weighted(&mut self, weights: &[f64]) -> Option<usize> {
        let usable = |w: f64| if w.is_finite() && w > 0.0 { w } else { 0.0 };
        let total: f64 = weights.iter().map(|&w| usable(w)).sum();
        if total <= 0.0 {
            return None;
        }
        let mut left = self.uniform() * total;
        let mut last = None;
        for (index, &weight) in weights.iter().enumerate() {
            let weight = usable(weight);
            if weight > 0.0 {
                last = Some(index);
                if left < weight {
                    break;
                }
                left -= weight;
            }
        }
        last
    }

    /// Shuffle `items` uniformly (Fisher-Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }
}
