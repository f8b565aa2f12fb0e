//! Lens files of Optiland: the JSON that its `save_optiland_file` writes.
//!
//! A file is an object with `aperture`, `fields`, `wavelengths` and `surface_group.surfaces`, from the object to the image. Every surface has a
//! geometry with a place in global coordinates (mm), and the medium behind it; angles are in radians, fields in degrees or mm. Older and newer
//! versions differ: how a surface acts on light is in keys of the surface or in its `interaction_model`, the kind of fields in `field_type` or
//! in `field_definition`. Both are read.
//!
//! The meaning of the keys follows the program's public source. What has an effect on rays and cannot be traced as it stands is refused with
//! its surface: mirrors, shifted and tilted surfaces, free-form geometries, gratings, phase profiles, scattering.
//!
//! ```
//! # use petzval_base::FileError;
//! use petzval_files::{parse_catalog, parse_optiland};
//! let catalog = parse_catalog("[glass.N-BK7]\nnd = 1.5168\nvd = 64.17\n")?;
//! let surface = |z: f64, radius: &str, is_stop: bool, medium: &str| {
//!     format!(
//!         r#"{{"type": "Surface", "geometry": {{"type": "StandardGeometry", "cs": {{"z": {z}}}, "radius": {radius}}},
//!            "material_post": {medium}, "is_stop": {is_stop}}}"#
//!     )
//! };
//! let air = r#"{"type": "IdealMaterial", "index": 1.0}"#;
//! let glass = r#"{"type": "Material", "name": "N-BK7"}"#;
//! let text = format!(
//!     r#"{{"aperture": {{"type": "EPD", "value": 10}},
//!       "fields": {{"fields": [{{"x": 0, "y": 0}}], "field_type": "angle"}},
//!       "wavelengths": {{"wavelengths": [{{"value": 587.6, "is_primary": true, "unit": "nm"}}]}},
//!       "surface_group": {{"surfaces": [
//!         {{"type": "ObjectSurface", "geometry": {{"type": "Plane", "cs": {{"z": -Infinity}}}}, "material_post": {air}}},
//!         {}, {}, {}]}}}}"#,
//!     surface(0.0, "50", true, glass),
//!     surface(4.0, "Infinity", false, air),
//!     surface(98.0, "Infinity", false, air),
//! );
//! let read = parse_optiland(&text, &catalog)?;
//! assert_eq!(read.file.lens.total_track_mm(), 98.0);
//! assert!(read.losses.is_empty());
//! # Ok::<(), FileError>(())
//! ```

mod material;
mod object;
mod read;
mod surface;
mod system;

pub use read::{parse_optiland, parse_optiland_start};
