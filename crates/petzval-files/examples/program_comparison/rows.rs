//! The comparison: pairs of values that should be equal, each with a tolerance.

use rayon::prelude::*;

use super::listed::{AtField, Listed, ListedLens, Modulation};
use super::ours::{Aim, Studied};

/// Why two values differ; each reason is a note of the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Because {
    /// The other program's first-order formulas ignore the r^2 term.
    SquareTerm,
    /// The other program's third-order sums ignore aspheric terms.
    Aspheres,
    /// The other program's exit pupil moves with the image plane.
    ExitPupil,
    /// The other program has another sign in its formula for the reference sphere.
    Sphere,
}

impl Because {
    /// The mark of the note.
    pub fn mark(self) -> &'static str {
        match self {
            Self::SquareTerm => "a",
            Self::Aspheres => "b",
            Self::ExitPupil => "c",
            Self::Sphere => "d",
        }
    }
}

/// Our value and another program's value by the same convention.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    pub ours: f64,
    pub theirs: f64,
    /// Largest difference that counts as agreement.
    pub tolerance: f64,
    /// Why the values disagree, if they do.
    pub because: Option<Because>,
}

/// Values of one quantity.
pub struct Row {
    pub quantity: String,
    pub unit: &'static str,
    pub digits: usize,
    /// Petzval's value by its own convention.
    pub own: f64,
    /// One pair per program, or per way of aiming.
    pub pairs: Vec<Option<Pair>>,
}

/// Modulation of a field in one section.
pub struct ModulationRow {
    pub field_deg: f64,
    pub section: &'static str,
    pub by: &'static str,
    /// Petzval's modulation through the real stop, by frequency.
    pub own: Vec<f64>,
    pub pairs: Vec<Pair>,
}

/// All compared values of a lens.
pub struct Compared {
    pub name: String,
    /// The built-in lens that it is.
    pub file: Option<String>,
    pub first_order: Vec<Row>,
    /// By field.
    pub rays: Vec<(f64, Vec<Row>)>,
    pub modulation: Vec<ModulationRow>,
}

/// Tolerance for values of formulas, mm: rounding.
const FORMULA_MM: f64 = 1e-9;
/// Tolerance for values of traced rays, mm and um: rounding.
const RAY: f64 = 1e-8;
/// Tolerance for ray-optics, mm. It places an object at infinity at 1e10 mm, which moves foci and pupils by about
/// `f^2 / 1e10`, and it aims chief rays to about 1e-6 mm.
const FAR_MM: f64 = 3e-6;
/// Tolerances of Optiland's modulation: from histograms of 252 bins, and from 512 points across the pupil.
const HISTOGRAM: f64 = 2e-3;
const PUPIL_POINTS: f64 = 5e-4;

/// The comparison of every lens.
pub fn compare(listed: &Listed) -> Vec<Compared> {
    listed.lenses.par_iter().map(|lens| compare_lens(lens, listed)).collect()
}

fn compare_lens(listed: &ListedLens, all: &Listed) -> Compared {
    let studied = Studied::new(listed, all.near_axis_height);
    let rays = listed.fields_deg.par_iter().enumerate();
    let modulation = listed.fields_deg.par_iter().enumerate();
    Compared {
        name: listed.name.clone(),
        file: listed.file.clone(),
        first_order: first_order_rows(listed, &studied),
        rays: rays.map(|(i, field)| (*field, ray_rows(listed, &studied, i))).collect(),
        modulation: modulation.flat_map(|(i, _)| modulation_rows(listed, all, &studied, i)).collect(),
    }
}

fn first_order_rows(listed: &ListedLens, studied: &Studied) -> Vec<Row> {
    let (a, b) = (&listed.optiland, &listed.rayoptics);
    let has_square = listed.surfaces.iter().any(|s| s.asphere_from_r2.as_ref().is_some_and(|a| a[0] != 0.0));
    let is_aspheric = listed.surfaces.iter().any(|s| s.asphere_from_r2.is_some());
    let square = has_square.then_some(Because::SquareTerm);
    let row = |quantity: &str, digits: usize, ours: f64, of: [(f64, f64, Option<Because>); 2]| {
        let pair = |(theirs, tolerance, because)| Some(Pair { ours, theirs, tolerance, because });
        Row { quantity: quantity.into(), unit: "mm", digits, own: ours, pairs: of.map(pair).to_vec() }
    };
    let ours = studied.paraxial();
    let (p, q) = (&a.paraxial, &b.paraxial);
    let moved = ((q.exit_pupil_at_mm - ours.exit_pupil_at_mm).abs() > 1e-4).then_some(Because::ExitPupil);
    let mut rows = vec![
        row("focal length", 8, ours.efl_mm, [(p.efl_mm, FORMULA_MM, square), (q.efl_mm, FORMULA_MM, square)]),
        row(
            "back focal length",
            8,
            ours.bfl_mm,
            [(p.bfl_mm, FORMULA_MM, square), (q.bfl_mm, FORMULA_MM, square)],
        ),
        row(
            "entrance pupil, from the first vertex",
            8,
            ours.entrance_pupil_at_mm,
            [(p.entrance_pupil_at_mm, FORMULA_MM, None), (q.entrance_pupil_at_mm, FAR_MM, None)],
        ),
        row(
            "exit pupil, from the last vertex",
            8,
            ours.exit_pupil_at_mm,
            [(p.exit_pupil_at_mm, FORMULA_MM, None), (q.exit_pupil_at_mm, 2e-5, moved)],
        ),
        row(
            "exit pupil, diameter",
            8,
            ours.exit_pupil_mm,
            [(p.exit_pupil_mm, FORMULA_MM, None), (q.exit_pupil_mm, FAR_MM, None)],
        ),
    ];
    let near = studied.near_axis();
    let (m, n) = (&a.near_axis, &b.near_axis);
    rows.push(row(
        "focal length, by a ray",
        8,
        near.efl_mm,
        [(m.efl_mm, RAY, None), (n.efl_mm, FAR_MM, None)],
    ));
    rows.push(row(
        "back focal length, by a ray",
        8,
        near.bfl_mm,
        [(m.bfl_mm, RAY, None), (n.bfl_mm, FAR_MM, None)],
    ));
    let last = near.focus_mm.len() - 1;
    if last > 0 {
        let colour = |focus: &[f64]| focus[0] - focus[last];
        rows.push(row(
            "axial colour, by rays",
            8,
            colour(&near.focus_mm),
            [(colour(&m.focus_mm), RAY, None), (colour(&n.focus_mm), RAY, None)],
        ));
    }
    let sums = studied.seidel_mm();
    let off_axis = listed.fields_deg.iter().any(|f| *f != 0.0);
    for (k, name) in ["S1", "S2", "S3", "S4", "S5"].into_iter().enumerate() {
        if k > 0 && !off_axis {
            break;
        }
        let ignored = (is_aspheric && k != 3).then_some(Because::Aspheres);
        let without = if k == 0 { square } else { None };
        rows.push(row(
            &format!("Seidel sum {name}"),
            10,
            sums[k],
            [(-a.seidel_mm[k], 1e-10, ignored), (b.seidel_mm[k], 1e-8, without)],
        ));
    }
    let by_surface = studied.seidel_by_surface_mm();
    let pairs = by_surface.iter().flatten().zip(b.seidel_by_surface_mm.iter().flatten());
    if off_axis {
        let worst = pairs.max_by(|x, y| (x.0 - x.1).abs().total_cmp(&(y.0 - y.1).abs()));
        let (ours, theirs) = worst.expect("surfaces");
        let pair = Pair { ours: *ours, theirs: *theirs, tolerance: 1e-7, because: None };
        rows.push(Row {
            quantity: "of the Seidel sums by surface, the one that differs most".into(),
            unit: "mm",
            digits: 10,
            own: *ours,
            pairs: vec![None, Some(pair)],
        });
    }
    rows
}

fn ray_rows(listed: &ListedLens, studied: &Studied, i: usize) -> Vec<Row> {
    let field_deg = listed.fields_deg[i];
    let (a, b, c) =
        (&listed.optiland.paraxial_aim[i], &listed.rayoptics.shifted_aim[i], &listed.optiland.stop_aim[i]);
    let own = studied.at_field(field_deg, Aim::Stop, None);
    let ours = [
        studied.at_field(field_deg, Aim::Paraxial, None),
        studied.at_field(field_deg, Aim::Shifted, b.reference_sphere_mm),
        studied.at_field(field_deg, Aim::TracedStop, None),
    ];
    let row = |quantity: &str, unit, digits, tolerance: [f64; 3], of: &dyn Fn(&AtField) -> f64| {
        let pair = |(k, theirs): (usize, &AtField)| {
            Some(Pair { ours: of(&ours[k]), theirs: of(theirs), tolerance: tolerance[k], because: None })
        };
        let pairs = [a, b, c].into_iter().enumerate().map(pair).collect();
        Row { quantity: quantity.into(), unit, digits, own: of(&own), pairs }
    };
    let last = listed.wavelengths_um.len() - 1;
    let ideal = studied.paraxial().efl_mm * field_deg.to_radians().tan();
    let mut rows = Vec::new();
    if field_deg != 0.0 {
        rows.push(row("chief ray, height", "mm", 7, [RAY, FAR_MM, RAY], &|f| f.reference_chief_mm));
        rows.push(row("distortion", "%", 6, [1e-7, 1e-4, 1e-7], &|f| {
            100.0 * (f.reference_chief_mm / ideal - 1.0)
        }));
        if last > 0 {
            rows.push(row("lateral colour", "um", 5, [1e-5, 1e-4, 1e-5], &|f| {
                1e3 * (f.chief_mm[0] - f.chief_mm[last])
            }));
        }
    }
    rows.push(row("sagittal focus", "mm", 7, [RAY, FAR_MM, RAY], &|f| f.sagittal_focus_mm));
    rows.push(row("tangential focus", "mm", 7, [RAY, FAR_MM, RAY], &|f| f.tangential_focus_mm));
    rows.push(row("RMS spot, one colour", "um", 5, [1e-6, 1e-4, 1e-6], &|f| f.rms_um));
    if last > 0 {
        rows.push(row("RMS spot, all colours", "um", 5, [1e-6, 1e-4, 1e-6], &|f| f.rms_poly_um));
    }
    let mut waves = row("RMS wavefront", "waves", 6, [1e-8, 1e-6, 1e-7], &|f| f.opd_rms_waves);
    waves.pairs[1].iter_mut().for_each(|p| p.because = Some(Because::Sphere));
    rows.push(waves);
    rows
}

fn modulation_rows(listed: &ListedLens, all: &Listed, studied: &Studied, i: usize) -> Vec<ModulationRow> {
    let field_deg = listed.fields_deg[i];
    let alike = studied.modulation_paraxial(field_deg, &all.frequencies_per_mm);
    let own = studied.modulation(field_deg);
    let theirs = &listed.optiland.mtf[i];
    let row = |section, by, tolerance, of: &dyn Fn(&Modulation) -> &Vec<f64>| ModulationRow {
        field_deg,
        section,
        by,
        own: of(&own).clone(),
        pairs: (of(&alike).iter().zip(of(theirs)))
            .map(|(ours, theirs)| Pair { ours: *ours, theirs: *theirs, tolerance, because: None })
            .collect(),
    };
    vec![
        row("tangential", "rays", HISTOGRAM, &|m| &m.geometric_tangential),
        row("sagittal", "rays", HISTOGRAM, &|m| &m.geometric_sagittal),
        row("tangential", "waves", PUPIL_POINTS, &|m| &m.fft_tangential),
        row("sagittal", "waves", PUPIL_POINTS, &|m| &m.fft_sagittal),
    ]
}
