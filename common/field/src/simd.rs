//! The SIMD levels of a machine. Every level gives the same bits; they differ in speed alone.

use std::fmt;
use std::str::FromStr;

use fearless_simd::Level;

/// An instruction set that this machine has.
///
/// A value can only be made on a machine that has it, so evaluation never
/// meets an instruction set that is missing.
#[derive(Clone, Copy)]
pub struct SimdLevel {
    token: Level,
}

/// A SIMD level that does not exist or that this machine lacks.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{asked}` is not a SIMD level of this machine, which has {available}")]
pub struct UnknownLevel {
    asked: String,
    available: String,
}

impl SimdLevel {
    /// The level without vector instructions: the definition of all others.
    pub fn scalar() -> Self {
        Self {
            token: Level::fallback(),
        }
    }

    /// The fastest level of this machine.
    pub fn best() -> Self {
        Self {
            token: Level::new(),
        }
    }

    /// Every level of this machine, slowest first.
    pub fn all_available() -> Vec<Self> {
        let best = Level::new();
        let mut levels = vec![Level::fallback()];
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        {
            levels.extend(best.as_sse4_2().map(Level::Sse4_2));
            levels.extend(best.as_avx2().map(Level::Avx2));
            levels.extend(best.as_avx512().map(Level::Avx512));
        }
        #[cfg(target_arch = "aarch64")]
        levels.extend(best.as_neon().map(Level::Neon));
        levels.into_iter().map(|token| Self { token }).collect()
    }

    /// Its name: `scalar`, `sse4.2`, `avx2`, `avx512` or `neon`.
    pub fn name(self) -> &'static str {
        match self.token {
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Level::Sse4_2(_) => "sse4.2",
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Level::Avx2(_) => "avx2",
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Level::Avx512(_) => "avx512",
            #[cfg(target_arch = "aarch64")]
            Level::Neon(_) => "neon",
            _ => "scalar",
        }
    }

    /// Runs `kernel` compiled for this level: its loops over arrays use the level's registers.
    ///
    /// Everything that the kernel calls in its loops must be inlined into it.
    #[inline(always)]
    pub fn vectorize<R>(self, kernel: impl FnOnce() -> R) -> R {
        dispatch!(self, simd => fearless_simd::Simd::vectorize(simd, kernel))
    }

    pub(crate) fn token(self) -> Level {
        self.token
    }
}

/// Runs an expression with the token of a level, compiled once for each.
///
/// Levels that the library knows and we do not count as scalar: a build for x86_64 uses SSE2 there anyway,
/// and every level more costs a fifth of this crate's compile time.
macro_rules! dispatch {
    ($level:expr, $simd:ident => $run:expr) => {{
        macro_rules! with {
            ($token:expr) => {{
                let $simd = $token;
                fearless_simd::Simd::vectorize(
                    $simd,
                    #[inline(always)]
                    || $run,
                )
            }};
        }
        match $level.token() {
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            fearless_simd::Level::Sse4_2(token) => with!(token),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            fearless_simd::Level::Avx2(token) => with!(token),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            fearless_simd::Level::Avx512(token) => with!(token),
            #[cfg(target_arch = "aarch64")]
            fearless_simd::Level::Neon(token) => with!(token),
            _ => with!(fearless_simd::Fallback::new()),
        }
    }};
}
pub(crate) use dispatch;

impl Default for SimdLevel {
    fn default() -> Self {
        Self::best()
    }
}

impl PartialEq for SimdLevel {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for SimdLevel {}

impl fmt::Debug for SimdLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl fmt::Display for SimdLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for SimdLevel {
    type Err = UnknownLevel;

    fn from_str(text: &str) -> Result<Self, UnknownLevel> {
        let levels = Self::all_available();
        match levels.iter().find(|level| level.name() == text) {
            Some(level) => Ok(*level),
            None => Err(UnknownLevel {
                asked: text.to_owned(),
                available: levels
                    .iter()
                    .map(|level| level.name())
                    .collect::<Vec<_>>()
                    .join(", "),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_have_names_that_parse() {
        for level in SimdLevel::all_available() {
            assert_eq!(level.to_string().parse(), Ok(level));
        }
        let refused = "avx9".parse::<SimdLevel>().unwrap_err().to_string();
        assert!(refused.contains("avx9") && refused.contains("scalar"));
        assert_eq!(SimdLevel::all_available()[0], SimdLevel::scalar());
        assert!(SimdLevel::all_available().contains(&SimdLevel::best()));
    }
}
