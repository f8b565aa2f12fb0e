//! Point-spread functions: what the lens makes of a point of light.

mod geometric;
mod splat;

pub use geometric::{FieldPsf, PsfCotangent, PsfOptions, PsfTape, psf, psf_with_tape};
