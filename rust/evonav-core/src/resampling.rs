//! Draws of clusters with replacement, the same numbers as NumPy's.

/// NumPy's PCG64: 128 bits of state, 64 bits a draw.
///
/// # Source
/// O'Neill, "PCG: A Family of Simple Fast Space-Efficient Statistically Good Algorithms for Random
/// Number Generation", 2014: XSL-RR 128/64.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pcg64 {
    /// State after the last draw.
    pub state: u128,
    /// Increment of the stream, an odd number.
    pub increment: u128,
}

const MULTIPLIER: u128 = 0x2360_ed05_1fc6_5da4_4385_df64_9fcc_f645;

impl Pcg64 {
    /// Draw a uniform number in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.state = self.state.wrapping_mul(MULTIPLIER).wrapping_add(self.increment);
        let folded = (self.state >> 64) as u64 ^ self.state as u64;
        let bits = folded.rotate_right((self.state >> 122) as u32);
        (bits >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }
}

/// Draw how often each of N clusters is in resamples of N clusters, with replacement.
///
/// Gives the counts of `Generator.multinomial(N, [1 / N] * N, size)`, a row after another: each
/// cluster's count is binomial, among what the clusters before it left, and drawn by inversion.
/// Inversion adds up chances from the chance of zero on, an exponential and a logarithm; it depends
/// on the cluster and on what is left alone, so it is stored for the numbers that are usually left.
///
/// NumPy takes another method where the mean of a count is above 30. What is left for the last
/// clusters has a mean of 1 each; so much more is less likely than 1e-30.
///
/// # Arguments
/// * `source` - stream of the draws; goes on behind them.
/// * `counts` - rows of N counts; more than 255 wrap.
/// * `num_clusters` - N; 0 draws nothing.
///
/// # Complexity
/// O(R N) time; O(N^1.5) memory.
///
/// # Source
/// Kachitvichyanukul & Schmeiser, "Binomial random variate generation", 1988: BINV.
pub fn draw_counts(source: &mut Pcg64, counts: &mut [u8], num_clusters: usize) {
    if num_clusters == 0 {
        return;
    }
    let mut clusters = Binomials::new(num_clusters);
    for row in counts.chunks_exact_mut(num_clusters) {
        let mut left = num_clusters;
        row.fill(0);
        for (place, count) in row[..num_clusters - 1].iter_mut().enumerate() {
            let drawn = clusters.draw(source, place, left);
            *count = drawn as u8;
            left -= drawn;
            if left == 0 {
                break;
            }
        }
        row[num_clusters - 1] = left as u8;
    }
}

/// The binomials of clusters one after another.
struct Binomials {
    /// Chance of each cluster among itself and those behind it; above a half, that of the others.
    chances: Vec<(f64, bool)>,
    /// Chance of a count of zero by cluster and by how much is left, from `first` of the cluster
    /// on; NaN where it was not needed yet.
    zeros: Vec<f64>,
    /// Numbers left that `zeros` has room for, for each cluster.
    width: usize,
}

impl Binomials {
    fn new(num_clusters: usize) -> Self {
        let share = 1.0 / num_clusters as f64;
        let mut rest = 1.0;
        let chances = (1..num_clusters).map(|_| {
            let p = share / rest;
            rest -= share;
            if p <= 0.5 { (p, false) } else { (1.0 - p, true) }
        });
        let chances: Vec<_> = chances.collect();
        // Eight standard deviations of what is left, half of the clusters through, to either side.
        let width = 16 + 8 * (num_clusters as f64).sqrt() as usize;
        let zeros = vec![f64::NAN; width * chances.len()];
        Self { chances, zeros, width }
    }

    /// Draw the count of a cluster, of what is `left`.
    fn draw(&mut self, source: &mut Pcg64, place: usize, left: usize) -> usize {
        let (p, is_other) = self.chances[place];
        let zero = self.zero(place, left, p);
        let drawn = invert(source, left, p, zero);
        if is_other { left - drawn } else { drawn }
    }

    /// Return the chance of a count of zero.
    fn zero(&mut self, place: usize, left: usize, p: f64) -> f64 {
        let chance = || (left as f64 * (-p).ln_1p()).exp();
        let first = (self.chances.len() + 1 - place).saturating_sub(self.width / 2);
        match left.checked_sub(first).filter(|&offset| offset < self.width) {
            Some(offset) => {
                let known = &mut self.zeros[place * self.width + offset];
                if known.is_nan() {
                    *known = chance();
                }
                *known
            }
            None => chance(),
        }
    }
}

/// Draw a binomial number by inversion: of `num` with chance `p`, where `zero` is that of none.
fn invert(source: &mut Pcg64, num: usize, p: f64, zero: f64) -> usize {
    let n = num as f64;
    let (q, mean) = (1.0 - p, n * p);
    let mut count = 0;
    let mut chance = zero;
    let mut u = source.uniform();
    while u > chance {
        count += 1;
        let x = count as f64;
        // A count this large is due to rounding: draw again. The bound is never below 10 or `num`.
        if x > 10.0_f64.min(n) && x > n.min(mean + 10.0 * (mean * q + 1.0).sqrt()).floor() {
            count = 0;
            chance = zero;
            u = source.uniform();
        } else {
            u -= chance;
            chance = ((n - x + 1.0) * p * chance) / (x * q);
        }
    }
    count
}
