//! Third-order and chromatic sums by surface, as aberrations of the image.

use schemars::JsonSchema;
use serde::Serialize;

use crate::lens::Lens;
use crate::seidel::{chromatic, seidel};

/// The sums of one surface, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct ThirdOrderSurface {
    /// Seidel sums S_I to S_V: spherical aberration, coma, astigmatism, Petzval curvature, distortion.
    pub seidel_mm: [f64; 5],
    /// Chromatic sums C_I (axial) and C_II (lateral) between the shortest and the longest wavelength.
    pub chromatic_mm: [f64; 2],
}

/// Sums of a lens for its full field at its reference wavelength.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ThirdOrder {
    /// The field, degrees.
    pub field_deg: f64,
    /// By surface.
    pub surfaces: Vec<ThirdOrderSurface>,
    /// Total of the lens.
    pub total: ThirdOrderSurface,
    /// The total as wavefront aberrations at the edge of pupil and field, waves of the reference wavelength: spherical W040,
    /// coma W131, astigmatism W222, field curvature W220, distortion W311.
    pub wavefront_waves: [f64; 5],
}

/// Third-order sums; `None` if third-order theory does not cover a surface (thin lenses, diffractive power) or the outermost field
/// (90 degrees and more).
pub fn third_order(lens: &Lens) -> Option<ThirdOrder> {
    let full = lens.outermost_field_deg();
    let sequence = lens.at_wavelength(lens.reference_um);
    let field = full.to_radians();
    let (low, high) =
        lens.wavelengths_um.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), w| (a.min(*w), b.max(*w)));
    let colours = chromatic(&sequence, &lens.at_wavelength(low), &lens.at_wavelength(high), field);
    let surfaces: Vec<ThirdOrderSurface> = seidel(&sequence, field)?
        .iter()
        .zip(colours)
        .map(|(sums, chromatic_mm)| ThirdOrderSurface { seidel_mm: sums.s, chromatic_mm })
        .collect();
    let mut total = ThirdOrderSurface::default();
    for s in &surfaces {
        for (t, v) in total.seidel_mm.iter_mut().zip(s.seidel_mm) {
            *t += v;
        }
        for (t, v) in total.chromatic_mm.iter_mut().zip(s.chromatic_mm) {
            *t += v;
        }
    }
    // W040 = S1/8, W131 = S2/2, W222 = S3/2, W220 = (S3 + S4)/4, W311 = S5/2 (Welford, chapter 8).
    let [s1, s2, s3, s4, s5] = total.seidel_mm;
    let wavefront_waves = [0.125 * s1, 0.5 * s2, 0.5 * s3, 0.25 * (s3 + s4), 0.5 * s5]
        .map(|mm| mm / (1e-3 * lens.reference_um));
    Some(ThirdOrder { field_deg: full, surfaces, total, wavefront_waves })
}
