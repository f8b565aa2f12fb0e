//! Lenses that tests share, built by hand.

use std::sync::Arc;

use petzval_optics::glass::{Dispersion, Glass};
use petzval_optics::lens::{
    ASPHERE_TERMS, Action, Axis, Departure, Lens, ObjectDistance, Pattern, Phase, Placement, Q_TERMS,
    Surface, SurfaceShape, XY_TERMS, xy_index,
};

/// The triplet of `crates/petzval-data/data/lenses/cooke-triplet-nominal.toml`.
#[allow(dead_code, reason = "each test file takes what it needs of this one")]
pub fn nominal_triplet() -> Lens {
    let glass = |name: &str, dispersion| Arc::new(Glass::new(name, dispersion));
    let pmma = glass(
        "PMMA",
        Dispersion::Schott([
            2.1864582,
            -0.00024475348,
            0.014155787,
            -0.00044329781,
            7.7664259e-05,
            -2.9936382e-06,
        ]),
    );
    let flint = glass(
        "N-SF11",
        Dispersion::Sellmeier {
            b: vec![1.73759695, 0.313747346, 1.89878101],
            c_um2: vec![0.013188707, 0.0623068142, 155.23629],
        },
    );
    let surface = |radius: f64, asphere: &[f64], thickness_mm, glass: &Arc<Glass>, semi| {
        let mut a = [0.0; ASPHERE_TERMS];
        a[..asphere.len()].copy_from_slice(asphere);
        Surface {
            label: String::new(),
            shape: SurfaceShape { curvature: 1.0 / radius, conic: 0.0, asphere: a, ..SurfaceShape::PLANE },
            thickness_mm,
            glass: glass.clone(),
            semi_diameter_mm: semi,
            ..Surface::default()
        }
    };
    let air = Glass::air();
    Lens {
        name: "Cooke triplet, nominal".into(),
        source: String::new(),
        surfaces: vec![
            surface(11.34, &[0.0, -4.06e-5, 1.3e-7, -5.02e-9, -2.8e-11], 4.014, &pmma, 7.733),
            surface(11.45, &[], 8.11, &air, 6.415),
            surface(-39.57, &[], 3.0, &flint, 4.56),
            surface(39.57, &[], 3.53, &air, 4.161),
            surface(f64::INFINITY, &[], 0.848, &air, 2.7298),
            surface(15.38, &[0.0, -2.07e-4, -4.4e-7, 4.42e-7, -2.23e-8], 2.698, &pmma, 3.594),
            surface(-13.05, &[], 24.525171110552694, &air, 3.606),
        ],
        stop: 4,
        entrance_pupil_mm: 5.7,
        object: ObjectDistance::Infinity,
        wavelengths_um: vec![0.486, 0.55, 0.62],
        reference_um: 0.5875618,
        fields_deg: vec![0.0, 5.0, 10.0, 15.0],
    }
}

/// The nominal triplet with one surface of every special kind at a time, and systems of mirrors.
#[allow(dead_code, reason = "each test file takes what it needs of this one")]
pub fn special_lenses() -> Vec<Lens> {
    let mut all = Vec::new();
    let mut add = |name: &str, change: &dyn Fn(&mut Vec<Surface>)| {
        let mut lens = nominal_triplet();
        lens.name = name.into();
        change(&mut lens.surfaces);
        all.push(lens);
    };
    let departs = |surface: usize, departure: Departure| {
        move |s: &mut Vec<Surface>| s[surface].shape.departure = departure
    };
    add("odd", &departs(3, Departure::Odd([0.0, 2e-4, -3e-6, 1e-7, 0.0, 0.0, 0.0, 1e-14])));
    let mut coefficients = [0.0; XY_TERMS];
    for (i, j, value) in
        [(0, 2, 4e-3), (2, 0, -3e-3), (2, 1, 1e-3), (0, 3, -2e-3), (2, 2, 7e-4), (4, 0, 5e-4), (0, 8, 1e-5)]
    {
        coefficients[xy_index(i, j)] = value;
    }
    add("xy", &departs(5, Departure::Xy { norm_radius_mm: 4.0, coefficients }));
    coefficients[xy_index(1, 1)] = 1e-3;
    coefficients[xy_index(3, 0)] = -1e-3;
    add("xy without symmetry", &departs(5, Departure::Xy { norm_radius_mm: 4.0, coefficients }));
    let mut coefficients = [0.0; Q_TERMS];
    coefficients[..5].copy_from_slice(&[3e-3, -2e-3, 1e-3, 5e-4, 1e-4]);
    coefficients[12] = 1e-5;
    add("Q_bfs", &departs(1, Departure::Qbfs { norm_radius_mm: 8.0, coefficients }));
    add("Q_con", &departs(6, Departure::Qcon { norm_radius_mm: 4.5, coefficients }));
    add("biconic", &departs(2, Departure::Biconic { curvature_x: -0.02, conic_x: 0.4 }));
    add("toroid", &departs(5, Departure::Toroid { curvature_x: 0.0645 }));
    add("cylinder", &departs(3, Departure::Toroid { curvature_x: 0.0 }));
    add("thin lens", &|s| {
        s[4].action = Action::ThinLens { power_per_mm: 0.004 };
    });
    add("grating", &|s| {
        s[3].phase = Some(Phase { order: 1, pattern: Pattern::Grating { lines_per_mm: 40.0 } });
    });
    add("binary", &|s| {
        let mut coefficients_rad = [0.0; 8];
        coefficients_rad[..3].copy_from_slice(&[-60.0, 15.0, -4.0]);
        let pattern = Pattern::Binary { norm_radius_mm: 4.0, coefficients_rad };
        s[6].phase = Some(Phase { order: 1, pattern });
    });
    let placed = |decenter_mm, tilt_deg: [f64; 3], axis| {
        Some(Placement { decenter_mm, tilt_rad: tilt_deg.map(f64::to_radians), axis })
    };
    add("tilted in the plane of symmetry", &|s| {
        s[2].placement = placed([0.0, 0.1], [1.5, 0.0, 0.0], Axis::Returns);
        s[5].placement = placed([0.0, -0.05], [-0.7, 0.0, 0.0], Axis::Returns);
    });
    add("tilted and decentred", &|s| {
        s[1].placement = placed([0.05, 0.1], [0.5, -0.8, 20.0], Axis::Returns);
        s[4].placement = placed([0.02, -0.03], [0.3, 0.2, 0.1], Axis::Returns);
        s[6].placement = placed([-0.1, 0.03], [0.4, 1.1, 0.0], Axis::Returns);
    });
    add("coordinate breaks", &|s| {
        s[2].placement = placed([0.1, 0.0], [1.0, 0.5, -3.0], Axis::Follows);
        s[4].placement = placed([-0.1, 0.05], [-0.6, -0.4, 2.0], Axis::Follows);
    });
    add("folded", &|s| {
        let air = Glass::air();
        let mirror = |tilt, semi| Surface {
            thickness_mm: 0.0,
            semi_diameter_mm: semi,
            glass: air.clone(),
            action: Action::Reflect,
            placement: placed([0.0, 0.0], tilt, Axis::Bends),
            ..Surface::default()
        };
        s[6].thickness_mm = 8.0;
        s.push(Surface { thickness_mm: -9.0, ..mirror([40.0, 10.0, 0.0], 8.0) });
        s.push(Surface { thickness_mm: 7.5, ..mirror([0.0, 30.0, 5.0], 8.0) });
    });
    for lens in &mut all {
        for s in &mut lens.surfaces {
            s.semi_diameter_mm *= 1.15;
        }
        *lens = petzval_optics::solve::with_paraxial_focus(lens, 0.0);
    }
    all.extend([telescope(), mangin()]);
    all
}

/// Two mirrors: a Ritchey-Chretien of 200 mm, f/8, whose second mirror blocks nothing.
#[allow(dead_code, reason = "each test file takes what it needs of this one")]
pub fn telescope() -> Lens {
    let mirror = |radius: f64, conic: f64, thickness_mm: f64, semi_diameter_mm: f64| Surface {
        shape: SurfaceShape { curvature: 1.0 / radius, conic, ..SurfaceShape::PLANE },
        thickness_mm,
        semi_diameter_mm,
        action: Action::Reflect,
        ..Surface::default()
    };
    let base = nominal_triplet();
    let mut lens = Lens {
        name: "Ritchey-Chretien".into(),
        surfaces: vec![mirror(-1200.0, -1.089_9, -420.0, 101.0), mirror(-550.0, -5.3, 541.0, 40.0)],
        stop: 0,
        entrance_pupil_mm: 200.0,
        fields_deg: vec![0.0, 0.3],
        ..base
    };
    let order = petzval_optics::paraxial::first_order(&lens.at_wavelength(lens.reference_um));
    lens.surfaces[1].thickness_mm = order.image_distance_mm;
    lens
}

/// A Mangin mirror: light passes the glass, is reflected at its rear and passes it again.
#[allow(dead_code, reason = "each test file takes what it needs of this one")]
pub fn mangin() -> Lens {
    let base = nominal_triplet();
    let flint = base.surfaces[2].glass.clone();
    let surface = |radius: f64, thickness_mm: f64, glass: &Arc<Glass>, action| Surface {
        shape: SurfaceShape { curvature: 1.0 / radius, ..SurfaceShape::PLANE },
        thickness_mm,
        semi_diameter_mm: 21.0,
        glass: glass.clone(),
        action,
        ..Surface::default()
    };
    let mut lens = Lens {
        name: "Mangin".into(),
        surfaces: vec![
            surface(-150.0, 5.0, &flint, Action::Refract),
            surface(-230.0, -5.0, &flint, Action::Reflect),
            surface(-150.0, -180.0, &Glass::air(), Action::Refract),
        ],
        stop: 0,
        entrance_pupil_mm: 40.0,
        fields_deg: vec![0.0, 2.0],
        ..base
    };
    let order = petzval_optics::paraxial::first_order(&lens.at_wavelength(lens.reference_um));
    lens.surfaces[2].thickness_mm = order.image_distance_mm;
    lens
}

/// A paraboloid of 20 mm: an image without aberration on its axis.
#[allow(dead_code, reason = "each test file takes what it needs of this one")]
pub fn paraboloid(f_number: f64) -> Lens {
    let entrance_pupil_mm = 20.0;
    let f = f_number * entrance_pupil_mm;
    let mirror = Surface {
        shape: SurfaceShape { curvature: -0.5 / f, conic: -1.0, ..SurfaceShape::PLANE },
        thickness_mm: -f,
        semi_diameter_mm: 11.0,
        action: Action::Reflect,
        ..Surface::default()
    };
    Lens { name: "paraboloid".into(), surfaces: vec![mirror], entrance_pupil_mm, ..telescope() }
}

/// A lens in front of an object at 150 mm, with a numerical aperture of about 0.05. The stop stands so far behind the focus of the reference
/// wavelength: chief rays are nearly parallel to the axis, and the entrance pupil is far away. The image plane is not where the image is.
#[allow(dead_code, reason = "each test file takes what it needs of this one")]
pub fn nearly_telecentric(beyond_focus_mm: f64, wavelengths_um: Vec<f64>, reference_um: f64) -> Lens {
    let glass = Arc::new(Glass::new("G", Dispersion::NdVd { nd: 1.5, vd: 60.0 }));
    let surface = |curvature: f64, thickness_mm: f64, glass: &Arc<Glass>| Surface {
        shape: SurfaceShape { curvature, ..SurfaceShape::PLANE },
        thickness_mm,
        glass: glass.clone(),
        semi_diameter_mm: 20.0,
        ..Surface::default()
    };
    let (air, distance_mm) = (Glass::air(), 150.0);
    let mut lens = Lens {
        surfaces: vec![surface(0.01, 5.0, &glass), surface(-0.01, 0.0, &air), surface(0.0, 0.0, &air)],
        stop: 2,
        object: ObjectDistance::Finite(distance_mm),
        wavelengths_um,
        reference_um,
        ..telescope()
    };
    let order = |lens: &Lens| petzval_optics::paraxial::first_order(&lens.at_wavelength(reference_um));
    lens.surfaces[1].thickness_mm = order(&lens).bfl_mm + beyond_focus_mm;
    lens.entrance_pupil_mm = 2.0 * 0.05 * (distance_mm + order(&lens).entrance_pupil_at_mm).abs();
    lens
}

/// Bessel function J1, by its integral.
#[allow(dead_code, reason = "each test file takes what it needs of this one")]
pub fn bessel_j1(x: f64) -> f64 {
    let n = 400;
    let at = |i: i32| std::f64::consts::PI * (f64::from(i) + 0.5) / f64::from(n);
    (0..n).map(|i| (at(i) - x * at(i).sin()).cos() / f64::from(n)).sum()
}
