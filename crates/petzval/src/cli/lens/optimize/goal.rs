//! The goal of an optimisation as arguments.

use crate::cli::choice::choice;
use crate::jobs::lens::optimize::{Goal, Vary};

/// The goal and the limits of an optimisation.
#[derive(Debug, clap::Args)]
pub struct GoalArgs {
    /// Wavelengths, um, all of the same weight [default: those of the lens]
    #[arg(long, value_delimiter = ',', value_name = "UM,...")]
    wavelengths: Vec<f64>,
    /// Field angles, degrees [default: those of the lens]
    #[arg(long, value_delimiter = ',', value_name = "DEG,...", allow_hyphen_values = true)]
    fields: Vec<f64>,
    /// Exponent: minimise the mean over the fields of RMS^P; 1 is the mean spot, 2 the mean square, 8 nearly the worst
    /// field
    #[arg(long, default_value_t = Goal::default().power, value_name = "P")]
    power: f64,
    /// Focal length to hold, mm, or `free` [default: that of the solve in the lens file, else that of the lens, or in
    /// its place the magnification of a near object]
    #[arg(long, value_name = "MM|free", allow_hyphen_values = true)]
    efl: Option<String>,
    /// Kinds of numbers that vary beside the variables of the lens file, within bounds about their own values
    #[arg(long, value_parser = choice::<Vary>(), value_delimiter = ',', value_name = "KIND,...")]
    vary: Vec<Vary>,
    /// Glass that a search may exchange: the surface in front of it, and the glasses to choose from beside its own [default: the
    /// whole catalogue]
    #[arg(long, value_name = "SURFACE[=NAME,...]")]
    glass: Vec<String>,
    /// F-number; determines the entrance pupil, from the focal length that is held or that of the start
    #[arg(long, value_name = "N")]
    f_number: Option<f64>,
    /// Least and greatest back focal length, mm, positive in the direction of the light
    #[arg(long, value_delimiter = ',', num_args = 1, value_name = "MIN,MAX", allow_hyphen_values = true)]
    bfl: Vec<f64>,
    /// Least edge thickness of every element, mm [default: 0.01]
    #[arg(long, value_name = "MM")]
    edge: Option<f64>,
    /// Least centre thickness of every element, mm
    #[arg(long, value_name = "MM")]
    centre: Option<f64>,
    /// Least air between elements, on the axis and at the edge, mm [default: 0.01]
    #[arg(long, value_name = "MM")]
    air: Option<f64>,
    /// Greatest track, mm: between any two of the vertices and the image plane
    #[arg(long, value_name = "MM")]
    track: Option<f64>,
    /// Greatest clear diameter of any surface, mm
    #[arg(long, value_name = "MM")]
    clear_diameter: Option<f64>,
    /// Greatest distortion at the outermost field, percent
    #[arg(long, value_name = "PERCENT")]
    distortion: Option<f64>,
    /// Steepest surface within its clear aperture, degrees
    #[arg(long, value_name = "DEG")]
    slope: Option<f64>,
    /// Greatest angle of the outermost chief ray to the axis at the image, degrees
    #[arg(long, value_name = "DEG")]
    chief_ray_angle: Option<f64>,
}

impl From<GoalArgs> for Goal {
    fn from(args: GoalArgs) -> Self {
        Self {
            restored: None,
            operands: None,
            vary: args.vary,
            wavelengths: args.wavelengths,
            fields: args.fields,
            power: args.power,
            efl: args.efl,
            glass: args.glass,
            f_number: args.f_number,
            bfl: args.bfl,
            edge: args.edge,
            centre: args.centre,
            air: args.air,
            track: args.track,
            clear_diameter: args.clear_diameter,
            distortion: args.distortion,
            slope: args.slope,
            chief_ray_angle: args.chief_ray_angle,
        }
    }
}
