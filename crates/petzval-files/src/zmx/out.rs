//! The lines and losses of a Zemax file while it is written.

use std::fmt::Write;

use crate::loss::Losses;
use petzval_optics::glass::Catalog;

/// The file as written so far.
pub(super) struct Out<'a> {
    pub text: String,
    pub losses: Losses,
    pub catalog: &'a Catalog,
}

impl Out<'_> {
    /// Adds a line.
    pub fn line(&mut self, line: std::fmt::Arguments<'_>) {
        let written = self.text.write_fmt(line).and_then(|()| self.text.write_char('\n'));
        written.expect("a string takes whatever is written");
    }
}
