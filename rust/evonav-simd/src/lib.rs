//! Compile kernels twice: for every processor of the target, and for those with AVX2.
//!
//! Rust's x86-64 is that of 2003, with vectors of 128 bits. Plain loops over arrays take fewer
//! instructions with those of 256 bits. Fused multiplication and addition, which rounds once
//! instead of twice, is left out: results are the same, bit for bit, on every processor.

#[cfg(target_arch = "x86_64")]
use std::sync::LazyLock;

/// Environment variable that keeps a process to the vectors of every processor of its target, so
/// that tests can compare both.
pub const NARROW_VECTORS: &str = "EVONAV_NARROW_VECTORS";

#[cfg(target_arch = "x86_64")]
static IS_WIDE: LazyLock<bool> = LazyLock::new(|| {
    std::env::var_os(NARROW_VECTORS).is_none() && is_x86_feature_detected!("avx2")
});

/// Return whether this process computes with wider vectors than those of every processor.
#[must_use]
pub fn is_wide() -> bool {
    #[cfg(target_arch = "x86_64")]
    return *IS_WIDE;
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// A computation whose inner loops gain from wide vectors.
pub trait Kernel {
    /// The result.
    type Output;

    /// Compute. Implementations, and what they call in inner loops, should be `#[inline(always)]`:
    /// a function that is not inlined is compiled for every processor.
    fn compute(self) -> Self::Output;
}

/// Compute with the widest vectors that the processor has.
///
/// # Examples
/// ```
/// struct Sum<'a>(&'a [u32]);
///
/// impl evonav_simd::Kernel for Sum<'_> {
///     type Output = u32;
///
///     #[inline(always)]
///     fn compute(self) -> u32 {
///         self.0.iter().sum()
///     }
/// }
/// assert_eq!(evonav_simd::compute(Sum(&[1, 2, 3])), 6);
/// ```
#[inline]
pub fn compute<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if is_wide() {
        // SAFETY: the processor has AVX2.
        return unsafe { with_avx2(kernel) };
    }
    kernel.compute()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.compute()
}
