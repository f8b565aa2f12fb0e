//! Exit codes of the command.

/// How the command ended, as a shell sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Code(u8);

impl Code {
    /// All went well.
    pub const SUCCESS: Self = Self(0);
    /// The job failed.
    pub const FAILURE: Self = Self(1);
    /// Bad usage or bad input.
    pub const INPUT: Self = Self(2);
    /// The store of units is full or cannot be reached, and no unit is lost: the same command goes on (EX_IOERR of sysexits).
    pub const STORE: Self = Self(74);
    /// A job was stopped by a signal and can go on: a checkpoint was written (EX_TEMPFAIL of sysexits).
    pub const STOPPED: Self = Self(75);

    /// The number that the process ends with.
    pub fn number(self) -> u8 {
        self.0
    }
}
