//! A small report for tests: a triplet in three states, two pictures, two curves.

use std::io::Cursor;
use std::sync::Arc;

use image::{ImageFormat, Rgb, RgbImage};
use petzval_optics::analysis::{AnalysisOptions, Layout, field_mtf, first_order_table, layout};
use petzval_optics::glass::{Dispersion, Glass};
use petzval_optics::lens::{ASPHERE_TERMS, Lens, ObjectDistance, Surface, SurfaceShape};
use petzval_optics::psf::{PsfOptions, psf};
use petzval_optics::pupil::Quadrature;

use crate::design_report::{
    CameraPicture, CameraView, Change, FieldPoint, FrameView, HeldOutScores, LossCurve, PictureView, PsfView,
    Report, Role, Score, TableRow, TaskPart,
};
use crate::prescription::SurfaceView;

const CAMERAS: [&str; 3] = ["nominal", "spot-optimised", "end-to-end"];
const LAYOUT_FIELDS_DEG: [f64; 3] = [0.0, 7.5, 15.0];
const WAVELENGTHS_UM: [f64; 3] = [0.62, 0.55, 0.486];

fn glass(name: &str, b: [f64; 3], c_um2: [f64; 3]) -> Arc<Glass> {
    let dispersion = Dispersion::Sellmeier { b: b.to_vec(), c_um2: c_um2.to_vec() };
    Arc::new(Glass::new(name, dispersion))
}

fn crown() -> Arc<Glass> {
    glass("N-BK7", [1.03961212, 0.231792344, 1.01046945], [0.00600069867, 0.0200179144, 103.560653])
}

fn flint() -> Arc<Glass> {
    glass("N-SF11", [1.73759695, 0.313747346, 1.89878101], [0.013188707, 0.0623068142, 155.23629])
}

fn plastic() -> Arc<Glass> {
    let terms = [2.1864582, -0.00024475348, 0.014155787, -0.00044329781, 7.7664259e-05, -2.9936382e-06];
    Arc::new(Glass::new("PMMA", Dispersion::Schott(terms)))
}

fn surface(radius_mm: f64, asphere: &[f64], thickness_mm: f64, glass: &Arc<Glass>, semi_mm: f64) -> Surface {
    let mut a = [0.0; ASPHERE_TERMS];
    a[..asphere.len()].copy_from_slice(asphere);
    Surface {
        label: String::new(),
        shape: SurfaceShape { curvature: 1.0 / radius_mm, asphere: a, ..SurfaceShape::PLANE },
        thickness_mm,
        glass: glass.clone(),
        semi_diameter_mm: semi_mm,
        ..Surface::default()
    }
}

fn lens(name: &str, surfaces: Vec<Surface>, stop: usize, entrance_pupil_mm: f64) -> Lens {
    Lens {
        name: name.into(),
        source: String::new(),
        surfaces,
        stop,
        entrance_pupil_mm,
        object: ObjectDistance::Infinity,
        wavelengths_um: vec![0.486, 0.55, 0.62],
        reference_um: 0.5875618,
        fields_deg: vec![0.0, 7.5, 15.0],
    }
}

/// A Cooke triplet with two plastic elements and four aspheric coefficients on two surfaces.
pub(crate) fn triplet() -> Lens {
    let (pmma, sf11, air) = (plastic(), flint(), Glass::air());
    let surfaces = vec![
        surface(11.34, &[0.0, -4.06e-5, 1.3e-7, -5.02e-9, -2.8e-11], 4.014, &pmma, 7.733),
        surface(11.45, &[], 8.11, &air, 6.415),
        surface(-39.57, &[], 3.0, &sf11, 4.56),
        surface(39.57, &[], 3.53, &air, 4.161),
        surface(f64::INFINITY, &[], 0.848, &air, 2.7298),
        surface(15.38, &[0.0, -2.07e-4, -4.4e-7, 4.42e-7, -2.23e-8], 2.698, &pmma, 3.594),
        surface(-13.05, &[], 24.5252, &air, 3.606),
    ];
    lens("Cooke triplet", surfaces, 4, 5.7)
}

/// A crown and a flint cemented together, the stop on the front.
pub(crate) fn cemented_doublet() -> Lens {
    let air = Glass::air();
    let surfaces = vec![
        surface(61.0, &[], 6.0, &crown(), 12.0),
        surface(-44.0, &[], 2.5, &flint(), 11.5),
        surface(-129.0, &[], 95.0, &air, 11.8),
    ];
    lens("doublet", surfaces, 0, 20.0)
}

/// The scores of [`rows`].
pub(crate) fn scores() -> Vec<Score> {
    let score = |title: &str, unit: &str, decimals| Score {
        title: title.into(),
        unit: unit.into(),
        decimals,
        higher_is_better: true,
        leads: title == "PSNR",
    };
    vec![score("1 − LPIPS", "", 4), score("PSNR", "dB", 2), score("SSIM", "", 4)]
}

/// Scores in which every step is a gain.
pub(crate) fn rows() -> Vec<TableRow> {
    let row = |i: usize, lpips, psnr, ssim, spot| TableRow {
        camera: CAMERAS[i].into(),
        scores: vec![lpips, psnr, ssim],
        is_ceiling: false,
        restored_error_percent: 0.1 * spot,
        rms_spot_um: spot,
        efl_mm: 23.01,
        f_number: 4.04,
        fov_deg: 30.0,
        corner_light_percent: 87.0,
        steps: 60,
    };
    vec![
        row(0, 0.9125, 29.84, 0.8710, 12.6),
        row(1, 0.9246, 30.61, 0.8842, 7.31),
        row(2, 0.9312, 31.14, 0.8920, 8.05),
    ]
}

/// A picture of stripes, PNG.
pub(crate) fn picture_png(width: u32, height: u32, softness: u32) -> Vec<u8> {
    let picture = RgbImage::from_fn(width, height, |x, y| {
        let bright = (x / 5 + y / 7) % 2 == 0;
        Rgb([if bright { 230 - 20 * softness as u8 } else { 30 }, (4 * x) as u8, (4 * y) as u8])
    });
    let mut png = Cursor::new(Vec::new());
    picture.write_to(&mut png, ImageFormat::Png).unwrap();
    png.into_inner()
}

/// The layout of a lens with a number of rays of each field.
pub(crate) fn layout_of(lens: &Lens, fields_deg: &[f64], rays: usize) -> Layout {
    let lens = Lens { fields_deg: fields_deg.to_vec(), ..lens.clone() };
    layout(&lens, &AnalysisOptions { layout_rays: rays, ..AnalysisOptions::default() })
}

/// A prescription of two surfaces, an aspheric one and the stop.
pub(crate) fn surfaces() -> Vec<SurfaceView> {
    let front = SurfaceView {
        radius_mm: 11.34,
        thickness_mm: 4.014,
        glass: "N-SF11".into(),
        semi_diameter_mm: 7.733,
        conic: 0.0,
        asphere: vec![(4, -4.06e-5), (6, 1.3e-7)],
        more: vec!["mirror = true".into()],
        is_stop: false,
    };
    let stop = SurfaceView {
        radius_mm: f64::INFINITY,
        thickness_mm: 0.848,
        glass: String::new(),
        semi_diameter_mm: 2.7298,
        conic: -1.0,
        asphere: Vec::new(),
        more: Vec::new(),
        is_stop: true,
    };
    vec![front, stop]
}

fn camera(i: usize) -> CameraView {
    let (options, quadrature) =
        (PsfOptions { grid: 64, pitch_um: 2.0, ..PsfOptions::default() }, Quadrature::grid(16).unwrap());
    let lens = triplet().with_image_distance(24.5252 - 0.05 * i as f64);
    let fields = [0.0_f64, 4.0, 8.0, 12.0, 15.0].map(f64::to_radians);
    let psfs = fields
        .iter()
        .filter_map(|f| {
            PsfView::new(&psf(&lens, *f, &WAVELENGTHS_UM, &quadrature, &options)?, &options, 8.25)
        })
        .collect();
    let change = Change {
        parameter: "image distance".into(),
        from: 24.5252,
        to: lens.image_distance_mm(),
        unit: "mm".into(),
        min: 24.4,
        max: 24.6,
    };
    let coarse = AnalysisOptions { pupil_cells: 16, frequency_points: 9, ..AnalysisOptions::default() };
    let mtf = LAYOUT_FIELDS_DEG.iter().filter_map(|deg| field_mtf(&lens, *deg, &coarse).ok()).collect();
    let over_field = [0.0, 7.5, 15.0].map(|field_deg| FieldPoint {
        field_deg,
        rms_um: 4.0 + field_deg,
        illumination: 1.0 - 0.02 * field_deg,
    });
    CameraView {
        name: CAMERAS[i].into(),
        first_order: first_order_table(&lens),
        surfaces: surfaces(),
        layout: layout_of(&lens, &LAYOUT_FIELDS_DEG, 9),
        mtf,
        over_field: over_field.into(),
        psfs,
        changes: if i > 0 { vec![change] } else { Vec::new() },
        setting_changes: Vec::new(),
        attribution: Vec::new(),
    }
}

/// A whole report.
pub(crate) fn report() -> Report {
    let shot = |i: usize| CameraPicture {
        camera: CAMERAS[i].into(),
        developed_png: picture_png(64, 64, 3),
        output_png: picture_png(64, 64, 2 - i as u32),
        scores: vec![0.92, 30.0, 0.9],
    };
    let picture = |number: usize| PictureView {
        title: "stripes".into(),
        number,
        role: None,
        focus: None,
        truth_png: picture_png(64, 64, 0),
        cameras: (0..3).map(shot).collect(),
    };
    let frame = |name: &str| FrameView { name: name.into(), png: picture_png(160, 100, 1) };
    let curve = |i: usize| LossCurve {
        camera: CAMERAS[i].into(),
        block: "network".into(),
        label: "L1 + LPIPS".into(),
        points: (0..50).map(|s| (s, 1.0 / (1.0 + s as f64 + i as f64))).collect(),
    };
    Report {
        title: "A test".into(),
        subtitle: "of a report".into(),
        command_line: "petzval design".into(),
        scores: scores(),
        table: rows(),
        cameras: (0..3).map(camera).collect(),
        layout_fields_deg: LAYOUT_FIELDS_DEG.to_vec(),
        reference_um: 0.5876,
        wavelengths_um: WAVELENGTHS_UM.to_vec(),
        half_diagonal_mm: 6.1,
        nyquist_per_mm: 85.32,
        held_out: Vec::new(),
        pictures: vec![picture(0), picture(1)],
        left_out: None,
        frames: ["scene", "nominal", "end-to-end"].map(frame).into(),
        has_isp: false,
        pictures_in_all: 2,
        one_seed: None,
        short: None,
        warnings: Vec::new(),
        task: TaskPart::default(),
        progress: None,
        made: None,
        losses: vec![curve(0), curve(2)],
        config_toml: "seed = 1".into(),
        environment: vec![("threads".into(), "2".into())],
        notes: vec!["one seed".into()],
    }
}

/// Scores of three photographs at three places: by PSNR the last camera is 1.0 dB behind the first on the axis, and 2.9 dB ahead at 0.93.
pub(crate) fn held_out() -> Vec<HeldOutScores> {
    let places = [(0.0, [0.4, -1.0]), (0.7, [0.8, 1.2]), (0.93, [1.1, 2.9])];
    let mut all = Vec::new();
    for (i, photograph) in ["a", "b", "c"].into_iter().enumerate() {
        for (relative_field, gains) in places {
            // Photographs differ by 1 dB, and gains by 0.1 dB.
            let shift = i as f64 - 1.0;
            let psnr = |gain: f64| 30.0 + shift + gain;
            let of = |psnr: f64| vec![0.9, psnr, 0.87];
            let gained = gains.map(|gain| of(psnr(gain + 0.1 * shift)));
            let [spot, end_to_end] = gained;
            all.push(HeldOutScores {
                photograph: photograph.into(),
                relative_field,
                scores: vec![of(psnr(0.0)), spot, end_to_end],
                found: Vec::new(),
            });
        }
    }
    all
}

/// The whole report with the scores of every picture, and the pictures that are chosen by them.
pub(crate) fn answered() -> Report {
    let report = report();
    let picture = |(number, role): (usize, Role)| PictureView {
        number,
        role: Some(role),
        ..report.pictures[0].clone()
    };
    let roles =
        [(8, Role::MostGain), (6, Role::Axis), (5, Role::Corner), (1, Role::Zone), (4, Role::MedianGain)];
    let pictures =
        roles.map(picture).into_iter().chain([PictureView { number: 2, ..report.pictures[0].clone() }]);
    Report { held_out: held_out(), pictures: pictures.collect(), pictures_in_all: 9, ..report }
}
