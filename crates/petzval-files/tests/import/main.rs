//! Files of Zemax and CODE V: every kind of record, encodings, errors with their line, first-order properties of catalogue
//! lenses, and round trips to the last bit.

#[path = "../../../petzval-optics/tests/built_in/mod.rs"]
mod built_in;
mod clear_apertures;
#[path = "../../../petzval-optics/tests/common/mod.rs"]
mod common;
mod header;
mod placements;
mod refusals;
mod round_trip;
mod support;
mod surfaces;
mod text;
