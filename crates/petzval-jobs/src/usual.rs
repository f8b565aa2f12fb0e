//! Defaults that several requests share.

/// The device that every build has.
pub(crate) fn device() -> String {
    "cpu".to_owned()
}

/// The seed of everything random.
pub(crate) fn seed() -> u64 {
    1
}
