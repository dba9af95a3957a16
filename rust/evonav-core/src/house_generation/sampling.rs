//! Draws from the distributions that the recipe uses.

use crate::rng::Stream;

/// Draw a uniform number between two bounds.
pub(super) fn uniform_in(stream: &mut Stream, [low, high]: [f64; 2]) -> f64 {
    low + (high - low) * stream.uniform()
}

/// Draw whether something of this probability happens.
pub(super) fn happens(stream: &mut Stream, probability: f64) -> bool {
    stream.uniform() < probability
}

/// Draw one of `items`; `None` if there are none.
pub(super) fn choose<'a, T>(stream: &mut Stream, items: &'a [T]) -> Option<&'a T> {
    items.get(stream.below(items.len()))
}

/// Draw from Beta(`alpha`, `beta`): a ratio of two Gamma draws.
pub(super) fn beta(stream: &mut Stream, [alpha, beta]: [f64; 2]) -> f64 {
    let (one, other) = (gamma(stream, alpha), gamma(stream, beta));
    // Both are 0 only if the shapes are so small that the draws underflow.
    if one + other > 0.0 { one / (one + other) } else { 0.5 }
}

/// Draw from Gamma(`shape`, 1), by Marsaglia & Tsang, "A Simple Method for Generating Gamma
/// Variables", TOMS 2000.
fn gamma(stream: &mut Stream, shape: f64) -> f64 {
    if shape < 1.0 {
        let power = (1.0 - stream.uniform()).powf(1.0 / shape);
        return gamma(stream, shape + 1.0) * power;
    }
    let d = shape - 1.0 / 3.0;
    let c = 1.0 / (9.0 * d).sqrt();
    loop {
        let normal = stream.normal();
        let v = (1.0 + c * normal).powi(3);
        let log_u = (1.0 - stream.uniform()).ln();
        if v > 0.0 && log_u < 0.5 * normal * normal + d - d * v + d * v.ln() {
            return d * v;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::beta;
    use crate::rng::Stream;

    /// Mean and variance of Beta(a, b) are a / (a + b) and ab / ((a + b)^2 (a + b + 1)).
    #[test]
    fn beta_has_its_mean_and_variance() {
        for [a, b] in [[0.5, 6.0], [1.25, 5.5], [12.0, 12.0], [3.5, 1.9], [4.0, 6.0]] {
            let mut stream = Stream::new(7, &["beta"]);
            let draws: Vec<f64> = (0..20_000).map(|_| beta(&mut stream, [a, b])).collect();
            let mean = draws.iter().sum::<f64>() / 20_000.0;
            let variance = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 20_000.0;
            let (sum, true_mean) = (a + b, a / (a + b));
            let true_variance = a * b / (sum * sum * (sum + 1.0));
            assert!((mean - true_mean).abs() < 5.0 * (true_variance / 20_000.0).sqrt());
            assert!((variance / true_variance - 1.0).abs() < 0.06, "{a} {b} {variance}");
        }
    }
}
