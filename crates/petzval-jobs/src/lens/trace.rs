//! `lens trace`: one ray through every surface.

use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::{aim_one, paraxial_launch};
use petzval_optics::trace::{Fate, launch, trace_ray};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::{JobError, Result};
use crate::glass_range::warn_of_wavelengths;
use crate::input::LensInput;
use crate::range::check_ranges;

/// How a ray finds its place in the pupil.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Aim {
    /// Through that point of the real stop.
    #[default]
    Real,
    /// Through that point of the paraxial entrance pupil.
    Paraxial,
}

petzval_base::parameters! {
    /// A ray through a lens.
    pub struct Request {
        /// Wavelength, um, 0.2 to 20.
        wavelength: f64 = 0.5876, "um", 0.2..20.0, Log, "550 nm is 0.55";
        /// Field angle, degrees: within 180 degrees of the axis, or 90 for a near object.
        field: f64 = 0.0, "deg", -180.0..180.0, Linear, "degrees from the axis; 0 is on it";
    }
    also {
        /// Lens: a built-in name, the path of a file, or the lens itself.
        lens: LensInput = LensInput::default();
        /// Point of the pupil, x and y in units of its radius.
        pupil: Vec<f64> = Vec::new();
        /// What the pupil point lies on.
        aim: Aim = Aim::default();
    }
}

/// The path of a ray.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// `ok`, or where the ray was lost.
    pub status: String,
    /// Every surface that the ray has met.
    pub surfaces: Vec<Place>,
    /// Where it meets the image plane; `None` if it was lost before.
    pub image: Option<Place>,
    /// Optical path up to the image plane, mm: from the plane of the first vertex if the object is at infinity, else from the
    /// object. `None` for fields of 90 degrees and more, whose light does not come through such a plane.
    pub opl_mm: Option<f64>,
}

/// Position and direction of a ray behind a surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Place {
    /// Position across, in the coordinates of the surface, mm.
    pub x_mm: f64,
    /// Position up, mm.
    pub y_mm: f64,
    /// Position along the axis from the vertex, mm.
    pub z_mm: f64,
    /// Direction cosine along x.
    pub l: f64,
    /// Direction cosine along y.
    pub m: f64,
    /// Direction cosine along z.
    pub n: f64,
}

impl Place {
    /// Of a ray in a medium of index `n`. Its direction is that of the ray as a line; after an odd number of mirrors `n` is
    /// negative, and light travels the other way along that line.
    fn new(position: [f64; 3], direction: [f64; 3], n: f64) -> Self {
        let [x_mm, y_mm, z_mm] = position;
        let [l, m, n] = direction.map(|cosine| cosine * n.signum());
        Self { x_mm, y_mm, z_mm, l, m, n }
    }
}

impl Request {
    /// The pupil point, once every setting is in its range.
    fn checked_pupil(&self, lens: &Lens) -> Result<[f64; 2]> {
        check_ranges(self)?;
        let pupil = || self.pupil.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        let [px, py] = self.pupil[..] else {
            return Err(JobError::setting(
                "pupil",
                pupil(),
                "needs two numbers",
                "for example --pupil 0,0.7",
            ));
        };
        if !(px.is_finite() && py.is_finite()) {
            let message = "not two finite numbers";
            return Err(JobError::setting("pupil", pupil(), message, "for example --pupil 0,0.7"));
        }
        let limit_deg = lens.object.field_limit_deg();
        if self.field.abs() >= limit_deg {
            let message = format!("not within {limit_deg} degrees of the axis");
            let hint = "degrees from the axis; 0 is on it";
            return Err(JobError::setting("field", self.field, message, hint));
        }
        Ok([px, py])
    }
}

/// Traces the ray. A ray that is lost is a response like any other.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let (name, context) = &request.lens.placed(context)?;
    let lens = context.assets.lens(name)?.lens;
    let pupil = request.checked_pupil(&lens)?;
    warn_of_wavelengths(&lens, &[request.wavelength], context);
    Ok(trace(&lens, request, pupil))
}

fn trace(lens: &Lens, request: &Request, pupil: [f64; 2]) -> Response {
    // Aim the ray at its point of the pupil.
    let sequence = lens.at_wavelength(request.wavelength);
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    let field = request.field.to_radians();
    let at = match request.aim {
        Aim::Paraxial => Some(paraxial_launch(&order, &sequence, field, pupil)),
        Aim::Real => aim_one(&sequence, field, order.stop_radius_mm, pupil),
    };
    let Some(at) = at else {
        return Response { status: status(Fate::NotAimed), surfaces: Vec::new(), image: None, opl_mm: None };
    };
    // Trace it, and note where it passes every surface.
    let start = launch(&sequence, field, at).ray;
    let path = trace_ray(&sequence, start);
    let surfaces = (path.passages.iter().zip(&sequence.surfaces))
        .map(|(p, s)| Place::new(p.point, p.direction_after, s.n_after))
        .collect();
    let n_image = sequence.surfaces.last().map_or(1.0, |s| s.n_after);
    // Add the path before the start of the trace: from the plane of the first vertex or from the object.
    let height = match lens.object {
        ObjectDistance::Infinity => start.position[2],
        ObjectDistance::Finite(distance) => distance + start.position[2],
    };
    let before = (request.field.abs() < 90.0).then(|| height / start.direction[2]);
    Response {
        status: status(path.fate),
        surfaces,
        image: path.image.map(|ray| Place::new(ray.position, ray.direction, n_image)),
        opl_mm: path.image.and(before).map(|before| before + path.optical_path_mm),
    }
}

fn status(fate: Fate) -> String {
    match fate {
        Fate::Ok => "ok".to_owned(),
        Fate::Missed(i) => format!("missed surface {}", i + 1),
        Fate::Clipped(i) => format!("clipped at surface {}", i + 1),
        Fate::TotalReflection(i) => format!("total internal reflection at surface {}", i + 1),
        Fate::NotAimed => "no ray passes this point of the stop".to_owned(),
    }
}
