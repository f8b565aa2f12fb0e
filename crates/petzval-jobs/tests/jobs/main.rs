//! Jobs, without the command.

mod control;
mod inline;
mod lens_and_glass;
mod lens_mtf;
mod measuring;
mod one_development;
mod pinhole_captures;
mod psf_files;
mod schema_check;
mod schemas;
mod table;
mod values;
mod weights;
mod whole_table;
