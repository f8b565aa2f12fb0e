//! The instruction set of the vector kernels, in this crate and in every crate above it.
//!
//! It is the widest of the machine, unless the environment variable `PETZVAL_SIMD` names a narrower one: `avx2` or
//! `scalar`.

use std::ffi::{OsStr, OsString};
use std::sync::OnceLock;

use pulp::{Arch, Simd, WithSimd};

/// The instruction set that `PETZVAL_SIMD` names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Requested {
    /// The widest of the machine: `best`, or the variable is unset or empty.
    Best,
    /// AVX2 with fused multiply-add if the machine has it, else the widest.
    Avx2,
    /// One number at a time.
    Scalar,
}

impl Requested {
    /// The instruction set of a value of the variable; `None` if there is none of this name.
    fn of(variable: Option<&OsStr>) -> Option<Self> {
        match variable.map(|value| value.to_str()) {
            Some(Some("best" | "")) | None => Some(Self::Best),
            Some(Some("avx2")) => Some(Self::Avx2),
            Some(Some("scalar")) => Some(Self::Scalar),
            Some(_) => None,
        }
    }
}

/// The variable that names an instruction set.
const VARIABLE: &str = "PETZVAL_SIMD";

fn requested() -> Requested {
    static REQUESTED: OnceLock<Requested> = OnceLock::new();
    *REQUESTED.get_or_init(|| Requested::of(std::env::var_os(VARIABLE).as_deref()).unwrap_or(Requested::Best))
}

/// Fails with the value of `PETZVAL_SIMD` if it is none of `avx2`, `scalar` and `best`. [`dispatch`] takes the widest instruction set then.
pub fn check_variable() -> Result<(), OsString> {
    match std::env::var_os(VARIABLE) {
        Some(value) if Requested::of(Some(&value)).is_none() => Err(value),
        _ => Ok(()),
    }
}

/// Runs an operation with the widest instruction set of the machine, or with the one that `PETZVAL_SIMD` names.
///
/// With `scalar` the operation runs as code for every machine of the architecture. In a plain loop the compiler may still
/// use vectors that all of those machines have (SSE2 on x86-64).
pub fn dispatch<Op: WithSimd>(operation: Op) -> Op::Output {
    dispatch_as(requested(), operation)
}

/// The instruction set that [`dispatch`] uses: `avx512`, `avx2`, `neon` or `scalar`.
pub fn level() -> &'static str {
    level_as(requested())
}

/// The widest vector unit that the CPU reports.
pub fn widest() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        if std::arch::is_x86_feature_detected!("avx512f") {
            return "avx512";
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            return "avx2";
        }
        "sse2"
    }
    #[cfg(target_arch = "aarch64")]
    {
        "neon"
    }
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    {
        "scalar"
    }
}

fn dispatch_as<Op: WithSimd>(requested: Requested, operation: Op) -> Op::Output {
    match requested {
        #[cfg(target_arch = "x86_64")]
        Requested::Avx2 => match pulp::x86::V3::try_new() {
            Some(v3) => v3.vectorize(Bound { simd: v3, operation }),
            None => Arch::new().dispatch(operation),
        },
        Requested::Scalar => operation.with_simd(pulp::Scalar::new()),
        _ => Arch::new().dispatch(operation),
    }
}

fn level_as(requested: Requested) -> &'static str {
    match dispatch_as(requested, Width) {
        8 => "avx512",
        4 => "avx2",
        2 => "neon",
        _ => "scalar",
    }
}

/// Doubles in a register.
struct Width;

impl WithSimd for Width {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        S::F64_LANES
    }
}

/// An operation with the instruction set that it runs with.
#[cfg(target_arch = "x86_64")]
struct Bound<Op> {
    simd: pulp::x86::V3,
    operation: Op,
}

#[cfg(target_arch = "x86_64")]
impl<Op: WithSimd> pulp::NullaryFnOnce for Bound<Op> {
    type Output = Op::Output;

    #[inline(always)]
    fn call(self) -> Op::Output {
        self.operation.with_simd(self.simd)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variable_selects_a_narrower_instruction_set() {
        let level = |variable: Option<&str>| level_as(Requested::of(variable.map(OsStr::new)).unwrap());
        assert_eq!(level(Some("scalar")), "scalar");
        assert_eq!([level(None), level(Some(""))], [level(Some("best")); 2]);
        for unknown in ["avx1024", "foo", "AVX2", " scalar"] {
            assert_eq!(Requested::of(Some(OsStr::new(unknown))), None, "{unknown:?}");
        }
        #[cfg(target_arch = "x86_64")]
        {
            let has_avx2 = pulp::x86::V3::try_new().is_some();
            assert_eq!(level(Some("avx2")), if has_avx2 { "avx2" } else { "scalar" });
            assert_eq!(level(None) == "avx512", pulp::x86::V4::try_new().is_some());
        }
    }
}
