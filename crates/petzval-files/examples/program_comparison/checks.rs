//! Checks of the page's explanations: each claim is a pair of values that are equal if the claim is true.

use super::listed::{Listed, ListedLens};
use super::ours::{Aim, Studied};

/// Two values that should be equal.
pub struct Check {
    /// The note of the page that the check supports.
    pub note: &'static str,
    pub lens: String,
    pub this: String,
    pub value: f64,
    pub that: String,
    pub other: f64,
    pub tolerance: f64,
}

/// Convergence of one value of Optiland with its number of rays.
pub struct Settling {
    pub lens: String,
    /// Rays along a side of the pupil, and the largest difference of the modulation on the axis from ours.
    pub by_rays: Vec<(usize, f64)>,
}

/// The checks of every claim of the page.
pub fn checks(listed: &Listed) -> Vec<Check> {
    listed.lenses.iter().flat_map(|lens| of_lens(lens, listed.near_axis_height)).collect()
}

fn of_lens(listed: &ListedLens, close: f64) -> Vec<Check> {
    let studied = Studied::new(listed, close);
    let (a, b) = (&listed.optiland, &listed.rayoptics);
    let mut found = Vec::new();
    let mut check = |note, (this, value): (&str, f64), (that, other): (&str, f64), tolerance| {
        let [this, that] = [this, that].map(String::from);
        found.push(Check { note, lens: listed.name.clone(), this, value, that, other, tolerance });
    };
    let terms = |from: usize| {
        let has = |a: &Vec<f64>| a.iter().skip(from).any(|v| *v != 0.0);
        listed.surfaces.iter().any(|s| s.asphere_from_r2.as_ref().is_some_and(has))
    };
    let has_square = listed.surfaces.iter().any(|s| s.asphere_from_r2.as_ref().is_some_and(|a| a[0] != 0.0));
    let ours = studied.paraxial();
    if has_square {
        let without = studied.without_terms(1);
        let efl = without.paraxial().efl_mm;
        check(
            "a",
            ("focal length, Optiland", a.paraxial.efl_mm),
            ("Petzval without the r^2 terms", efl),
            1e-9,
        );
        check(
            "a",
            ("focal length, ray-optics", b.paraxial.efl_mm),
            ("Petzval without the r^2 terms", efl),
            1e-9,
        );
        check(
            "a",
            ("focal length, Petzval", ours.efl_mm),
            ("Optiland, traced ray", a.near_axis.efl_mm),
            2e-6,
        );
        check(
            "a",
            ("focal length, Petzval", ours.efl_mm),
            ("ray-optics, traced ray", b.near_axis.efl_mm),
            2e-6,
        );
        let s1 = without.seidel_mm()[0];
        check("a", ("S1, ray-optics", b.seidel_mm[0]), ("Petzval without the r^2 terms", s1), 1e-8);
    }
    if terms(0) {
        let sphere = studied.without_terms(usize::MAX).seidel_mm();
        let off_axis = listed.fields_deg.iter().any(|f| *f != 0.0);
        for (k, name) in [(0, "S1"), (1, "S2"), (2, "S3"), (4, "S5")] {
            if k == 0 || off_axis {
                let this = format!("{name}, Optiland");
                let that = "Petzval without aspheric terms";
                check("b", (this.as_str(), -a.seidel_mm[k]), (that, sphere[k]), 1e-9);
            }
        }
    }
    let by_rays = studied.spherical_by_rays_mm();
    check("b", ("S1, Petzval", studied.seidel_mm()[0]), ("of traced rays of the axis", by_rays), 1e-6);
    let from_image = b.paraxial.exit_pupil_at_mm - studied.focus_beyond_mm();
    if studied.focus_beyond_mm().abs() > 1e-4 && !has_square {
        let moved = ("ray-optics, less the distance from image plane to paraxial focus", from_image);
        check("c", ("exit pupil, Petzval", ours.exit_pupil_at_mm), moved, 1e-5);
    }
    let crosses = ("ray-optics, traced chief ray of 0.01 degrees", b.narrow_chief_crosses_mm);
    check("c", ("exit pupil, Petzval", ours.exit_pupil_at_mm), crosses, 3e-6);
    for (i, field) in listed.fields_deg.iter().enumerate() {
        let theirs = &b.shifted_aim[i];
        let alike = studied.at_field(*field, Aim::Shifted, theirs.reference_sphere_mm).opd_rms_waves;
        let turned = theirs.opd_rms_by_the_sphere_waves.unwrap_or(f64::NAN);
        let this = format!("RMS wavefront at {field} degrees, Petzval");
        check("d", (this.as_str(), alike), ("ray-optics, with the other sign", turned), 5e-6);
    }
    let far = ours.efl_mm * ours.efl_mm / 1e10;
    let apart = b.near_axis.bfl_mm - a.near_axis.bfl_mm;
    check(
        "far",
        ("back focal length by a ray, ray-optics less Optiland", apart),
        ("f^2 / 1e10 mm", far),
        1e-8,
    );
    found
}

/// Convergence of Optiland's diffraction MTF on the axis.
pub fn settling(listed: &Listed) -> Vec<Settling> {
    let of = |lens: &ListedLens| {
        let studied = Studied::new(lens, listed.near_axis_height);
        let ours = studied.modulation_paraxial(0.0, &listed.frequencies_per_mm).fft_tangential;
        let apart = |curve: &[f64]| ours.iter().zip(curve).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let by_rays = lens.optiland.fft_on_axis_by_rays.iter().map(|row| (row[0] as usize, apart(&row[1..])));
        Settling { lens: lens.name.clone(), by_rays: by_rays.collect() }
    };
    listed.lenses.iter().map(of).collect()
}
