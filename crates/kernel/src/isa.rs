//! Instruction sets: which ones the machine has, and how a caller forces one.
use std::{fmt, str::FromStr};

use fearless_simd::Level;

use crate::error::IsaError;

/// An instruction set that the kernels are compiled for. All give the same hits up to rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Isa {
    /// x86 with AVX-512 of the Ice Lake class.
    Avx512,
    /// x86-64-v3: AVX2 and FMA.
    Avx2,
    /// x86-64-v2.
    Sse42,
    /// 64-bit ARM.
    Neon,
    /// WebAssembly with 128-bit SIMD.
    Wasm128,
    /// Plain arithmetic, on every machine.
    Scalar,
}

impl Isa {
    /// All instruction sets, best first.
    pub const ALL: [Self; 6] =
        [Self::Avx512, Self::Avx2, Self::Sse42, Self::Neon, Self::Wasm128, Self::Scalar];

    /// Those that this machine can run, best first; never empty.
    #[must_use]
    pub fn available() -> Vec<Self> {
        Self::ALL.into_iter().filter(|isa| isa.level().is_some()).collect()
    }

    /// The best one that this machine can run.
    #[must_use]
    pub fn best() -> Self {
        Self::ALL.into_iter().find(|isa| isa.level().is_some()).unwrap_or(Self::Scalar)
    }

    /// The one that the environment variable `HELIOSTAT_ISA` forces, or `None` if it is unset or empty.
    ///
    /// # Errors
    /// [`IsaError`] if the value is unknown or this machine cannot run it.
    pub fn from_env() -> Result<Option<Self>, IsaError> {
        match std::env::var("HELIOSTAT_ISA") {
            Ok(name) if !name.is_empty() => {
                let isa: Self = name.parse()?;
                isa.checked_level().map(|_| Some(isa))
            }
            _ => Ok(None),
        }
    }

    /// The name used by `HELIOSTAT_ISA`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Avx512 => "avx512",
            Self::Avx2 => "avx2",
            Self::Sse42 => "sse4.2",
            Self::Neon => "neon",
            Self::Wasm128 => "wasm128",
            Self::Scalar => "scalar",
        }
    }

    /// The dispatch level, or the error that says what there is instead.
    pub(crate) fn checked_level(self) -> Result<Level, IsaError> {
        self.level().ok_or_else(|| IsaError::Unavailable {
            isa: self,
            available: Self::available().iter().map(|isa| isa.name()).collect::<Vec<_>>().join(", "),
        })
    }

    /// The level of `fearless_simd` at which this machine runs it, or `None` if it cannot.
    #[must_use]
    pub fn level(self) -> Option<Level> {
        let level = Level::new();
        match self {
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Avx512 => level.as_avx512().map(Level::Avx512),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Avx2 => level.as_avx2().map(Level::Avx2),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Sse42 => level.as_sse4_2().map(Level::Sse4_2),
            #[cfg(target_arch = "aarch64")]
            Self::Neon => level.as_neon().map(Level::Neon),
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Wasm128 => level.as_wasm_simd128().map(Level::WasmSimd128),
            Self::Scalar => Some(Level::fallback()),
            _ => {
                let _ = level;
                None
            }
        }
    }
}

impl fmt::Display for Isa {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Isa {
    type Err = IsaError;

    fn from_str(name: &str) -> Result<Self, IsaError> {
        let known = Self::ALL.into_iter().find(|isa| isa.name().eq_ignore_ascii_case(name));
        known.ok_or_else(|| IsaError::Unknown { name: name.to_owned() })
    }
}
