//! Jobs, without the command.

mod control;
mod lens_and_glass;
mod lens_mtf;
mod measuring;
mod one_development;
mod pinhole_captures;
mod table;
mod whole_table;
