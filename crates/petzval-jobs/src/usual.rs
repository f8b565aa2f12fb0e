//! Defaults that several requests share.

/// The device that every build has.
pub fn device() -> String {
    "cpu".to_owned()
}

/// The seed of everything random.
pub fn seed() -> u64 {
    1
}

/// Threads of a call: those of the process.
pub fn threads() -> usize {
    0
}

/// The nominal lens of the experiments.
pub fn lens() -> String {
    "cooke-triplet-nominal".to_owned()
}

/// The sensor of the experiments.
pub fn sensor() -> String {
    "imx249-fitted".to_owned()
}

/// Parameters of an ISP that vary: all.
pub fn every_parameter() -> Vec<String> {
    vec!["all".to_owned()]
}
