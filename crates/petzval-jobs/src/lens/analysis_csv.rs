//! The curves of `lens analyze` as comma-separated values.

use petzval_base::{csv_number, csv_text};
use petzval_optics::analysis::{Analysis, MtfCurve};

/// A number of a table; `None` is an empty cell.
type Cell = Option<f64>;

/// A file: its name, and what makes its text.
pub(super) type Table = (&'static str, fn(&Analysis) -> String);

/// The files. Each has a head with units, and a line for every point of every curve; what does not exist is left empty.
pub(super) const TABLES: [Table; 9] = [
    ("spots.csv", spots),
    ("fans.csv", fans),
    ("mtf.csv", mtf),
    ("mtf_by_field.csv", mtf_by_field),
    ("mtf_through_focus.csv", mtf_through_focus),
    ("field_curves.csv", field_curves),
    ("axial_colour.csv", axial_colour),
    ("longitudinal_aberration.csv", longitudinal_aberration),
    ("encircled_energy.csv", encircled_energy),
];

fn table<const N: usize>(head: [&str; N], lines: impl Iterator<Item = [Cell; N]>) -> String {
    csv_text([head.map(str::to_owned)].into_iter().chain(lines.map(|line| line.map(csv_number))))
}

fn spots(analysis: &Analysis) -> String {
    let lines = analysis.spots.iter().flat_map(|spot| {
        let colours = analysis.wavelengths_um.iter().zip(&spot.points_um);
        colours.flat_map(|(um, points)| points.iter().map(|[x, y]| [spot.field_deg, *um, *x, *y].map(Some)))
    });
    table(["field_deg", "wavelength_um", "x_um", "y_um"], lines)
}

fn fans(analysis: &Analysis) -> String {
    let head = [
        "field_deg",
        "wavelength_um",
        "pupil",
        "tangential_um",
        "sagittal_um",
        "tangential_waves",
        "sagittal_waves",
    ];
    let lines = analysis.fans.iter().flat_map(|fan| {
        let colours = analysis.wavelengths_um.iter().enumerate();
        colours.flat_map(move |(colour, um)| {
            fan.pupil.iter().enumerate().map(move |(i, pupil)| {
                let of = |curve: &[Vec<Cell>]| curve[colour][i];
                let [ty, sx] = [of(&fan.tangential_um), of(&fan.sagittal_um)];
                let [tw, sw] = [of(&fan.tangential_waves), of(&fan.sagittal_waves)];
                [Some(fan.field_deg), Some(*um), Some(*pupil), ty, sx, tw, sw]
            })
        })
    });
    table(head, lines)
}

/// Both sections of a curve at a point.
fn sections(curve: Option<&MtfCurve>, i: usize) -> [Cell; 2] {
    [curve.map(|c| c.sagittal[i]), curve.map(|c| c.tangential[i])]
}

const BY_RAYS_AND_WAVES: [&str; 4] =
    ["sagittal_by_rays", "tangential_by_rays", "sagittal_by_waves", "tangential_by_waves"];

fn mtf(analysis: &Analysis) -> String {
    let [a, b, c, d] = BY_RAYS_AND_WAVES;
    let lines = analysis.mtf.iter().flat_map(|mtf| {
        mtf.frequency_per_mm.iter().enumerate().map(move |(i, frequency)| {
            let [rays_s, rays_t] = sections(Some(&mtf.geometric), i);
            let [waves_s, waves_t] = sections(mtf.diffraction.as_ref(), i);
            let [limit_s, limit_t] = sections(mtf.limit.as_ref(), i);
            [Some(mtf.field_deg), Some(*frequency), rays_s, rays_t, waves_s, waves_t, limit_s, limit_t]
        })
    });
    table(["field_deg", "frequency_per_mm", a, b, c, d, "sagittal_limit", "tangential_limit"], lines)
}

fn mtf_by_field(analysis: &Analysis) -> String {
    let [a, b, c, d] = BY_RAYS_AND_WAVES;
    let mtf = &analysis.mtf_by_field;
    let lines = mtf.frequency_per_mm.iter().enumerate().flat_map(|(k, frequency)| {
        mtf.field_deg.iter().enumerate().map(move |(i, field)| {
            let [rays_s, rays_t] = sections(mtf.geometric.get(k), i);
            let [waves_s, waves_t] = sections(mtf.diffraction.as_ref().map(|curves| &curves[k]), i);
            [Some(*frequency), Some(*field), rays_s, rays_t, waves_s, waves_t]
        })
    });
    table(["frequency_per_mm", "field_deg", a, b, c, d], lines)
}

fn mtf_through_focus(analysis: &Analysis) -> String {
    let [a, b, c, d] = BY_RAYS_AND_WAVES;
    let lines = analysis.mtf_through_focus.iter().flat_map(|mtf| {
        mtf.defocus_mm.iter().enumerate().map(move |(i, defocus)| {
            let [rays_s, rays_t] = sections(Some(&mtf.geometric), i);
            let [waves_s, waves_t] = sections(mtf.diffraction.as_ref(), i);
            let [field, frequency, defocus] = [mtf.field_deg, mtf.frequency_per_mm, *defocus].map(Some);
            [field, frequency, defocus, rays_s, rays_t, waves_s, waves_t]
        })
    });
    table(["field_deg", "frequency_per_mm", "defocus_mm", a, b, c, d], lines)
}

fn field_curves(analysis: &Analysis) -> String {
    let head = [
        "field_deg",
        "wavelength_um",
        "tangential_focus_mm",
        "sagittal_focus_mm",
        "distortion_percent",
        "f_theta_distortion_percent",
        "lateral_colour_um",
        "relative_illumination",
    ];
    let curves = &analysis.field_curves;
    let lines = analysis.wavelengths_um.iter().enumerate().flat_map(|(colour, um)| {
        curves.field_deg.iter().enumerate().map(move |(i, field)| {
            let of = |curve: &[Vec<f64>]| Some(curve[colour][i]);
            [
                Some(*field),
                Some(*um),
                of(&curves.tangential_focus_mm),
                of(&curves.sagittal_focus_mm),
                of(&curves.distortion_percent),
                of(&curves.f_theta_distortion_percent),
                of(&curves.lateral_colour_um),
                of(&curves.relative_illumination),
            ]
        })
    });
    table(head, lines)
}

fn axial_colour(analysis: &Analysis) -> String {
    let colour = &analysis.axial_colour;
    let lines = colour.wavelength_um.iter().zip(&colour.shift_mm).map(|(um, shift)| [Some(*um), *shift]);
    table(["wavelength_um", "shift_mm"], lines)
}

fn longitudinal_aberration(analysis: &Analysis) -> String {
    let aberration = &analysis.longitudinal_aberration;
    let lines = analysis.wavelengths_um.iter().zip(&aberration.crossing_mm).flat_map(|(um, crossings)| {
        let points = aberration.pupil.iter().zip(crossings);
        points.map(|(pupil, crossing)| [Some(*um), Some(*pupil), *crossing])
    });
    table(["wavelength_um", "pupil", "crossing_mm"], lines)
}

fn encircled_energy(analysis: &Analysis) -> String {
    let lines = analysis.encircled_energy.iter().flat_map(|energy| {
        energy.radius_um.iter().enumerate().map(|(i, radius)| {
            let by_waves = energy.diffraction.as_ref().map(|shares| shares[i]);
            [Some(energy.field_deg), Some(*radius), Some(energy.geometric[i]), by_waves]
        })
    });
    table(["field_deg", "radius_um", "by_rays", "by_waves"], lines)
}
