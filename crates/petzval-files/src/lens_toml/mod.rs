//! The lens file in TOML: a lens, its published properties, and its variables.
//!
//! ```
//! # use petzval_base::FileError;
//! use petzval_files::{parse_catalog, parse_lens};
//! let catalog = parse_catalog("[glass.N-BK7]\nnd = 1.5168\nvd = 64.17\n")?;
//! let file = parse_lens(
//!     r#"
//! name = "singlet"
//! source = "a plano-convex lens of 100 mm"
//! units = "mm"
//!
//! [aperture]
//! entrance_pupil_diameter_mm = 10.0
//!
//! [object]
//! distance_mm = inf
//!
//! [wavelengths]
//! um = [0.4861, 0.5876, 0.6563]
//!
//! [fields]
//! angle_deg = [0.0, 2.0]
//!
//! [[surface]]
//! stop = true
//! radius_mm = 51.68
//! thickness_mm = 4.0
//! glass = "N-BK7"
//! semi_diameter_mm = 6.0
//!
//! [[surface]]
//! radius_mm = inf
//! thickness_mm = 97.3
//! semi_diameter_mm = 6.0
//!
//! [[variable]]
//! surface = 1
//! parameter = "radius_mm"
//! min = 40.0
//! max = 60.0
//! "#,
//!     &catalog,
//! )?;
//! assert_eq!(file.lens.total_track_mm(), 101.3);
//! # Ok::<(), FileError>(())
//! ```
//!
//! Surfaces are counted from 1 in the file and from 0 in [`LensFile`].

mod parameter;
mod read;
mod read_surface;
mod text;
mod write;

pub use parameter::parameter_name;
pub use read::{parse_lens, parse_lens_start};
pub use write::{special_lines, write_lens};

use crate::field_weights::{WeightFault, uneven_weights};
use petzval_optics::design_space::{EflSolve, MagnificationSolve, Pickup, Solves, Variable};
use petzval_optics::lens::Lens;

/// The content of a lens file.
#[derive(Clone, Debug, PartialEq)]
pub struct LensFile {
    /// The lens.
    pub lens: Lens,
    /// The properties that its source publishes.
    pub expect: Option<Expect>,
    /// Weights of the lens's fields in optimisations, one per field; all the same if it is empty.
    pub field_weights: Vec<f64>,
    /// The variables, with their bounds.
    pub variables: Vec<Variable>,
    /// The pickups: numbers that follow variables. Radii follow as curvatures.
    pub pickups: Vec<Pickup>,
    /// The solve for the focal length: the radius that it determines.
    pub efl_solve: Option<EflSolve>,
    /// The solve for the magnification of a near object: the radius that it determines. A file has this or the solve for the focal length.
    pub magnification_solve: Option<MagnificationSolve>,
    /// The solve for the length: the surface whose thickness it determines, and the distance from the first vertex to the
    /// last, mm.
    pub length_solve: Option<(usize, f64)>,
}

impl LensFile {
    /// A lens without weights, variables, solves and published properties.
    pub fn of(lens: Lens) -> Self {
        Self {
            lens,
            expect: None,
            field_weights: Vec::new(),
            variables: Vec::new(),
            pickups: Vec::new(),
            efl_solve: None,
            magnification_solve: None,
            length_solve: None,
        }
    }

    /// The solves of the file.
    pub fn solves(&self) -> Solves {
        Solves {
            efl: self.efl_solve,
            length: self.length_solve,
            magnification: self.magnification_solve,
            ..Solves::default()
        }
    }

    /// Sets the fields, degrees, ascending. Those that the lens had keep their weights, others have 1.
    pub fn set_fields(&mut self, fields_deg: Vec<f64>) {
        if !self.field_weights.is_empty() {
            let before = || self.lens.fields_deg.iter().zip(&self.field_weights);
            let of =
                |field: &f64| before().find(|(known, _)| *known == field).map_or(1.0, |(_, weight)| *weight);
            let weights: Vec<f64> = fields_deg.iter().map(of).collect();
            // Where the fields that counted are gone, all count.
            self.field_weights =
                if WeightFault::of(&weights).is_some() { Vec::new() } else { uneven_weights(weights) };
        }
        self.lens.fields_deg = fields_deg;
    }

    /// Takes over these variables and the radius that holds the focal length or the magnification.
    pub fn give(&mut self, variables: Vec<Variable>, solves: &Solves) {
        self.variables = variables;
        (self.efl_solve, self.magnification_solve) = (solves.efl, solves.magnification);
    }
}

/// Published properties, against which the lens is tested.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Expect {
    /// Effective focal length, mm.
    pub efl_mm: Option<Expected>,
    /// Last vertex to the paraxial focus, mm.
    pub bfl_mm: Option<Expected>,
    /// Focal length over entrance pupil diameter.
    pub f_number: Option<Expected>,
    /// First vertex to the paraxial focus, mm.
    pub total_track_mm: Option<Expected>,
    /// RMS spot radius at each field, um, with all wavelengths equally weighted, in the file's image plane. Rays are spread
    /// evenly over the paraxial entrance pupil, as design programs do by default.
    pub rms_spot_um: Option<ExpectedSpots>,
}

/// A published number and its tolerance, both in the unit of the key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// The published value.
    pub value: f64,
    /// The largest difference that still agrees.
    pub tolerance: f64,
}

impl Expected {
    /// Whether a measured value agrees.
    pub fn agrees(&self, measured: f64) -> bool {
        (measured - self.value).abs() <= self.tolerance
    }
}

/// Published spots, one per field, with a relative tolerance.
#[derive(Clone, Debug, PartialEq)]
pub struct ExpectedSpots {
    /// The published values, one per field, um.
    pub values_um: Vec<f64>,
    /// The largest relative difference that still agrees.
    pub relative_tolerance: f64,
}

/// The JSON Schema of a lens file. Numbers that may be infinite are written `inf` in TOML, which the schema calls a number.
pub fn lens_schema() -> schemars::Schema {
    schemars::schema_for!(text::LensText)
}
