//! The adjoint against central differences, for every number of the lens.

mod common;

use common::{nominal_triplet, special_lenses};
use petzval_optics::analysis::first_order_table;
use petzval_optics::constraint::{Constraint, penalty};
use petzval_optics::design_space::{
    DesignSpace, EflSolve, Focus, MagnificationSolve, Pickup, SmoothSpace, Solves, Variable,
};
use petzval_optics::glass::{Dispersion, Glass};
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::{Action, Departure, Lens, ObjectDistance, Pattern, Phase, Surface, SurfaceShape};
use petzval_optics::merit::{Merit, SpotResiduals};
use petzval_optics::number::Number;
use petzval_optics::optimize::Limits;
use petzval_optics::paraxial::{
    FirstOrderCotangent, first_order, image_brightness, image_height_per_tangent, pull_back_first_order,
    pull_back_image_distance, pull_back_image_height, pull_back_log_brightness,
};
use petzval_optics::psf::{
    FieldPsf, PsfCotangent, PsfKind, PsfOptions, PsfTape, psf_traced_with_tape, psf_with_tape,
};
use petzval_optics::pupil::{Quadrature, chief_ray, paraxial_launch};
use petzval_optics::solve::with_paraxial_focus;
use petzval_optics::spot::{mean_square_spot, mean_square_spot_traced, spot};
use petzval_optics::trace::{AimedRays, RayBundle, Reaim, Seeds, landing_jacobian, pull_back, trace};

type Shift = Box<dyn Fn(&mut Lens, f64)>;
type Read = Box<dyn Fn(&LensGradient) -> f64>;

/// A number of the lens: how to shift it, by how much, and where its derivative is.
struct Knob {
    name: String,
    step: f64,
    shift: Shift,
    read: Read,
}

fn knobs(lens: &Lens) -> Vec<Knob> {
    let mut all: Vec<Knob> = Vec::new();
    for i in 0..lens.surfaces.len() {
        let mut add = |name: &str, step: f64, shift: Shift, read: Read| {
            all.push(Knob { name: format!("surface {} {name}", i + 1), step, shift, read });
        };
        add(
            "thickness",
            1e-5,
            Box::new(move |l, h| l.surfaces[i].thickness_mm += h),
            Box::new(move |g| g[(i, Number::Thickness)]),
        );
        let is_plane = matches!(lens.surfaces[i].action, Action::ThinLens { .. });
        if i != lens.stop && !is_plane {
            add(
                "curvature",
                1e-7,
                Box::new(move |l, h| l.surfaces[i].shape.curvature += h),
                Box::new(move |g| g[(i, Number::Curvature)]),
            );
            add(
                "conic",
                1e-4,
                Box::new(move |l, h| l.surfaces[i].shape.conic += h),
                Box::new(move |g| g[(i, Number::Conic)]),
            );
            for j in 0..8 {
                // A shift that moves the surface by 2e-5 mm at its rim.
                let step = 2e-5 * lens.surfaces[i].semi_diameter_mm.powi(-2 * (j as i32 + 1));
                add(
                    &format!("a{}", 2 * (j + 1)),
                    step,
                    Box::new(move |l, h| l.surfaces[i].shape.asphere[j] += h),
                    Box::new(move |g| g[(i, Number::Asphere(j))]),
                );
            }
            add(
                "clear semi-diameter",
                1e-5,
                Box::new(move |l, h| l.surfaces[i].semi_diameter_mm += h),
                Box::new(move |g| g[(i, Number::SemiDiameter)]),
            );
        }
        // A mirror has the glass in front behind it.
        if !lens.surfaces[i].glass.is_air() && lens.surfaces[i].action != Action::Reflect {
            add(
                "index",
                1e-6,
                Box::new(move |l, h| shift_index(l, i, h)),
                Box::new(move |g| g[(i, Number::Index)]),
            );
        }
        let surface = &lens.surfaces[i];
        for (k, value) in surface.shape.departure.numbers().into_iter().enumerate() {
            // Coefficients of normalised polynomials are lengths; of plain odd powers, they move the rim alike.
            let step = match surface.shape.departure {
                Departure::Odd(_) => 2e-5 * surface.semi_diameter_mm.powi(-2 * k as i32 - 1),
                Departure::Biconic { .. } | Departure::Toroid { .. } => [1e-6, 1e-3][k],
                _ => 1e-6,
            };
            add(
                &format!("departure {k} = {value}"),
                step,
                Box::new(move |l, h| *l.surfaces[i].shape.departure.number_mut(k).unwrap() += h),
                Box::new(move |g| g[(i, Number::Departure(k))]),
            );
        }
        if let Some(mut phase) = surface.phase {
            for k in (0..8).filter(|k| phase.number_mut(*k).is_some()) {
                add(
                    &format!("phase {k}"),
                    1e-3,
                    Box::new(move |l, h| {
                        *l.surfaces[i].phase.as_mut().unwrap().number_mut(k).unwrap() += h;
                    }),
                    Box::new(move |g| g[(i, Number::Phase(k))]),
                );
            }
        }
        if let Action::ThinLens { .. } = surface.action {
            add(
                "power",
                1e-7,
                Box::new(move |l, h| {
                    if let Action::ThinLens { power_per_mm } = &mut l.surfaces[i].action {
                        *power_per_mm += h;
                    }
                }),
                Box::new(move |g| g[(i, Number::Power)]),
            );
        }
        if surface.placement.is_some() {
            for k in 0..2 {
                add(
                    &format!("decentre {k}"),
                    1e-5,
                    Box::new(move |l, h| l.surfaces[i].placement.as_mut().unwrap().decenter_mm[k] += h),
                    Box::new(move |g| g[(i, Number::Decenter(k))]),
                );
            }
            for k in 0..3 {
                add(
                    &format!("tilt {k}"),
                    1e-6,
                    Box::new(move |l, h| l.surfaces[i].placement.as_mut().unwrap().tilt_rad[k] += h),
                    Box::new(move |g| g[(i, Number::Tilt(k))]),
                );
            }
        }
    }
    all.push(Knob {
        name: "entrance pupil".into(),
        step: 2e-6 * lens.entrance_pupil_mm,
        shift: Box::new(|l, h| l.entrance_pupil_mm += h),
        read: Box::new(|g| g.entrance_pupil),
    });
    all
}

/// Shifts the index of the medium behind a surface by h at every wavelength.
fn shift_index(lens: &mut Lens, surface: usize, h: f64) {
    let glass = lens.surfaces[surface].glass.clone();
    let at: Vec<f64> = [lens.wavelengths_um.clone(), vec![lens.reference_um]].concat();
    let mut at = at;
    at.sort_by(f64::total_cmp);
    let index = at.iter().map(|w| glass.index(*w) + h).collect();
    lens.surfaces[surface].glass =
        std::sync::Arc::new(Glass::new(glass.name.as_str(), Dispersion::Table { wavelength_um: at, index }));
}

/// Compares with fourth-order central differences, each knob's step times the first of `steps` that fits: short
/// steps drown in rounding, long ones in curvature, and not for every knob alike. `tolerance` is relative to the
/// derivative, after what the rounding of the loss can explain.
fn check(lens: &Lens, gradient: &LensGradient, loss: &dyn Fn(&Lens) -> f64, steps: &[f64], tolerance: f64) {
    let size = loss(lens).abs();
    for knob in knobs(lens) {
        let at = |h: f64| {
            let mut moved = lens.clone();
            (knob.shift)(&mut moved, h);
            loss(&moved)
        };
        let analytic = (knob.read)(gradient);
        let by_step = |step: &f64| {
            let h = step * knob.step;
            let numeric = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
            // Rounding of the loss (1e-13 of it) limits what a difference can show.
            let error = (analytic - numeric).abs() - 20.0 * 1e-13 * size / h;
            (error / analytic.abs().max(1e-12), numeric)
        };
        let mut tried = Vec::new();
        let fits = steps.iter().any(|step| {
            tried.push(by_step(step));
            tried.last().is_some_and(|(relative, _)| *relative < tolerance)
        });
        assert!(fits, "{}: {}: {analytic:e} against (error, value) {tried:?}", lens.name, knob.name);
    }
}

fn near(mut lens: Lens) -> Lens {
    lens.object = ObjectDistance::Finite(400.0);
    lens.with_image_distance(26.2)
}

#[test]
fn rms_spot() {
    for lens in [nominal_triplet(), near(nominal_triplet())] {
        let fields: Vec<f64> = [0.0, 7.0, 14.0].map(f64::to_radians).to_vec();
        let value = |l: &Lens| mean_square_spot(l, &fields).unwrap().0;
        let (_, gradient) = mean_square_spot(&lens, &fields).unwrap();
        check(&lens, &gradient, &value, &[1.0], 1e-6);
    }
}

#[test]
fn rms_spot_with_special_surfaces() {
    for lens in special_lenses() {
        let far = lens.fields_deg.last().unwrap().to_radians();
        let fields =
            if lens.is_rotationally_symmetric() { vec![0.0, 0.6 * far] } else { vec![-0.4 * far, 0.6 * far] };
        let value = |l: &Lens| mean_square_spot(l, &fields).unwrap().0;
        let (_, gradient) = mean_square_spot(&lens, &fields).unwrap();
        // Systems of mirrors are longer and larger, and their spots small: they need longer steps.
        check(&lens, &gradient, &value, &[0.3, 1.0, 3.0, 100.0], 1e-6);
    }
}

#[test]
fn rms_spot_of_traced_rays_without_symmetry() {
    let quadrature = Quadrature::grid(12).unwrap();
    for lens in special_lenses().into_iter().filter(|l| !l.is_mirror_symmetric()) {
        let fields = [-6.0, 9.0].map(f64::to_radians);
        let value = |l: &Lens| mean_square_spot_traced(l, &fields, &quadrature).unwrap().0;
        let (_, gradient) = mean_square_spot_traced(&lens, &fields, &quadrature).unwrap();
        check(&lens, &gradient, &value, &[0.3, 1.0, 3.0], 1e-6);
    }
}

#[test]
fn psf_loss_with_special_surfaces() {
    let chosen = ["xy without symmetry", "toroid", "binary", "tilted and decentred", "coordinate breaks"];
    for lens in special_lenses().into_iter().filter(|l| chosen.contains(&l.name.as_str())) {
        // On a grid that holds all of their light.
        check_psf_loss_on(3.0, psf_with_tape, &lens, 0.1, 96, 1e-6);
        check_psf_loss_on(3.0, psf_traced_with_tape, &lens, 0.1, 48, 1e-6);
    }
}

/// A grating whose order is evanescent for a ray along the axis, on which lost rays and padding are put.
#[test]
fn rms_spot_behind_a_grating_that_stops_the_axis() {
    let mut lens = nominal_triplet();
    lens.surfaces.truncate(2);
    lens.stop = 0;
    lens.surfaces[0].shape = SurfaceShape::PLANE;
    lens.surfaces[0].phase = Some(Phase { order: 1, pattern: Pattern::Grating { lines_per_mm: 1800.0 } });
    lens.surfaces[0].glass = Glass::air();
    lens.surfaces[0].thickness_mm = 5.0;
    lens.surfaces[1] = Surface {
        action: Action::ThinLens { power_per_mm: 0.02 },
        thickness_mm: 49.0,
        semi_diameter_mm: 30.0,
        ..Surface::default()
    };
    lens.wavelengths_um = vec![0.5876];
    let fields = [f64::to_radians(-35.0)];
    let value = |l: &Lens| mean_square_spot(l, &fields).unwrap().0;
    let (_, gradient) = mean_square_spot(&lens, &fields).unwrap();
    assert!(gradient.numbers().iter().all(|v| v.is_finite()));
    check(&lens, &gradient, &value, &[0.3, 1.0, 3.0, 30.0], 1e-6);
}

/// Where a few rays land, aimed at the stop: the kernels alone, without what is made of the rays.
#[test]
fn landings_on_special_surfaces() {
    for lens in special_lenses() {
        let field = 0.7 * lens.fields_deg.last().unwrap().to_radians();
        // The stop counts by its points, not by the pupil: in this test the stop radius is the first one's.
        let stop = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
        let targets = [[0.3, 0.2], [-0.5, 0.6], [0.1, -0.9], [0.8, -0.1]].map(|p| p.map(|p| p * stop));
        let guess = |l: &Lens| {
            let order = first_order(&l.at_wavelength(l.reference_um));
            let sequence = l.at_wavelength(l.reference_um);
            targets.map(|t| paraxial_launch(&order, &sequence, field, t.map(|t| t / stop)))
        };
        let aim = |l: &Lens| AimedRays::new(&l.at_wavelength(l.reference_um), field, &targets, &guess(l));
        // Weighed sum of landings, all of them about the first lens's.
        let landings = |l: &Lens| {
            let sequence = l.at_wavelength(l.reference_um);
            let aimed = aim(l);
            assert!((0..4).all(|i| aimed.is_aimed(i)), "{}", l.name);
            let mut rays = aimed.bundle(&sequence);
            trace(&sequence, &mut rays);
            (0..4).flat_map(|i| [rays.ray(i).position[0], rays.ray(i).position[1]]).collect::<Vec<_>>()
        };
        let at = landings(&lens);
        let weights = [0.7, -0.3, 0.2, 0.9, -0.5, 0.4, -0.8, 0.6];
        let loss = |l: &Lens| {
            landings(l).iter().zip(&at).zip(weights).map(|((v, at), w)| w * (v - at)).sum::<f64>() + 0.1
        };
        let sequence = lens.at_wavelength(lens.reference_um);
        let aimed = aim(&lens);
        let mut seeds = Seeds::zero(4);
        for i in 0..4 {
            seeds.image_x[i] = weights[2 * i];
            seeds.image_y[i] = weights[2 * i + 1];
        }
        let nothing = vec![0.0; RayBundle::padded(4)];
        let reaim = Reaim { aimed: &aimed, launch_bar: [&nothing, &nothing] };
        let mut gradient = LensGradient::zero(lens.surfaces.len());
        pull_back(&sequence, &aimed.bundle(&sequence), &seeds, Some(&reaim), &mut gradient);
        check(&lens, &gradient, &loss, &[0.1, 1.0, 10.0], 1e-6);

        // The same by the Jacobian of every landing.
        let numbers: Vec<(usize, Number)> = (0..lens.surfaces.len())
            .flat_map(|s| {
                let own = lens.surfaces[s].shape.departure.numbers().len();
                let own = (0..own).map(Number::Departure);
                let all =
                    [Number::Curvature, Number::Conic, Number::Thickness, Number::Asphere(1), Number::Index];
                own.chain(all).chain((0..8).map(Number::Phase)).chain([Number::Power]).map(move |n| (s, n))
            })
            .collect();
        let jacobian = landing_jacobian(&sequence, &aimed, &numbers);
        for ((s, number), by) in numbers.iter().zip(&jacobian.by) {
            let sum: f64 = (0..4).map(|i| weights[2 * i] * by[0][i] + weights[2 * i + 1] * by[1][i]).sum();
            let expected = gradient[(*s, *number)];
            assert!((sum - expected).abs() < 1e-10 * (1.0 + expected.abs()), "{} {number:?}", lens.name);
        }
    }
}

#[test]
fn rms_spot_of_traced_rays() {
    let quadrature = Quadrature::grid(12).unwrap();
    for lens in [nominal_triplet(), near(nominal_triplet())] {
        let fields: Vec<f64> = [0.0, 7.0, 14.0].map(f64::to_radians).to_vec();
        let value = |l: &Lens| mean_square_spot_traced(l, &fields, &quadrature).unwrap().0;
        let (_, gradient) = mean_square_spot_traced(&lens, &fields, &quadrature).unwrap();
        check(&lens, &gradient, &value, &[1.0], 1e-6);
    }
}

/// Apertures in front of the stop and behind it cut the beam.
fn vignetted() -> (Lens, Vec<f64>) {
    let mut lens = nominal_triplet();
    lens.surfaces[0].semi_diameter_mm = 6.6;
    lens.surfaces[5].semi_diameter_mm = 3.1;
    let fields: Vec<f64> = [14.0_f64.to_radians()].to_vec();
    let spot = spot(&lens, fields[0], &Quadrature::grid(40).unwrap()).unwrap();
    let whole =
        petzval_optics::spot::spot(&nominal_triplet(), fields[0], &Quadrature::grid(40).unwrap()).unwrap();
    assert!(
        spot.illumination[1] < 0.985 * whole.illumination[1],
        "{:?} {:?}",
        spot.illumination,
        whole.illumination
    );
    (lens, fields)
}

#[test]
fn rms_spot_with_vignetting() {
    let (lens, fields) = vignetted();
    let value = |l: &Lens| mean_square_spot(l, &fields).unwrap().0;
    let (_, gradient) = mean_square_spot(&lens, &fields).unwrap();
    check(&lens, &gradient, &value, &[1.0], 1e-5);
}

#[test]
fn rms_spot_of_traced_rays_with_vignetting() {
    let (lens, fields) = vignetted();
    let quadrature = Quadrature::grid(40).unwrap();
    let value = |l: &Lens| mean_square_spot_traced(l, &fields, &quadrature).unwrap().0;
    let (_, gradient) = mean_square_spot_traced(&lens, &fields, &quadrature).unwrap();
    check(&lens, &gradient, &value, &[1.0], 1e-5);
}

type MakePsf = fn(&Lens, f64, &[f64], &Quadrature, &PsfOptions) -> Option<(FieldPsf, PsfTape)>;

fn check_psf_loss(make: MakePsf, lens: &Lens, field: f64, cells: usize, tolerance: f64) {
    check_psf_loss_on(1.0, make, lens, field, cells, tolerance);
}

fn check_psf_loss_on(pitch_um: f64, make: MakePsf, lens: &Lens, field: f64, cells: usize, tolerance: f64) {
    let options = PsfOptions { pitch_um, ..PsfOptions::default() };
    check_psf_loss_with(options, make, lens, field, cells, tolerance);
}

fn check_psf_loss_with(
    options: PsfOptions,
    make: MakePsf,
    lens: &Lens,
    field: f64,
    cells: usize,
    tolerance: f64,
) {
    let quadrature = Quadrature::grid(cells).unwrap();
    // A smooth template makes the loss smooth too: fit the PSF to a very wide Gaussian off centre.
    let side = options.grid as i32;
    let template: Vec<f64> = (0..side * side)
        .map(|i| {
            let scale = 128.0 / f64::from(side);
            let (x, y) = (f64::from(i % side) * scale - 60.0, f64::from(i / side) * scale - 66.0);
            (-(x * x + y * y) / 3200.0).exp()
        })
        .collect();
    let loss = |l: &Lens| -> f64 {
        let (p, _) = make(l, field, &l.wavelengths_um, &quadrature, &options).unwrap();
        let correlation: f64 =
            p.values.iter().map(|v| v.iter().zip(&template).map(|(a, b)| a * b).sum::<f64>()).sum();
        correlation + 0.3 * p.illumination.iter().map(|i| i * i).sum::<f64>() + 0.2 * p.chief_y_mm.powi(2)
    };
    let (p, tape) = make(lens, field, &lens.wavelengths_um, &quadrature, &options).unwrap();
    let cotangent = PsfCotangent {
        values: vec![template.clone(); 3],
        illumination: p.illumination.iter().map(|i| 0.6 * i).collect(),
        chief_y: 0.4 * p.chief_y_mm,
    };
    let gradient = tape.gradient(&p, &quadrature, &cotangent);
    // The splat's second derivative jumps between cells, so differences need short steps; waves have no such jumps.
    let steps: &[f64] = match options.kind {
        PsfKind::Geometric => &[0.03, 0.1, 0.3],
        PsfKind::Diffraction => &[0.3, 1.0, 3.0, 10.0, 30.0],
    };
    check(lens, &gradient, &loss, steps, tolerance);
}

#[test]
fn psf_loss() {
    for lens in [nominal_triplet(), near(nominal_triplet())] {
        check_psf_loss(psf_with_tape, &lens, 9.0_f64.to_radians(), 96, 1e-6);
    }
}

#[test]
fn diffraction_psf_loss() {
    let slow = Lens { entrance_pupil_mm: 2.5, ..nominal_triplet() };
    let options = PsfOptions { grid: 32, pitch_um: 2.0, kind: PsfKind::Diffraction };
    for lens in [slow.clone(), near(slow)] {
        check_psf_loss_with(options, psf_with_tape, &lens, 9.0_f64.to_radians(), 12, 1e-5);
    }
}

#[test]
fn psf_loss_with_vignetting() {
    // The soft edge's second derivative jumps too, and only many points across it make the sum smooth.
    let (lens, fields) = vignetted();
    check_psf_loss(psf_with_tape, &lens, fields[0], 768, 1e-4);
}

#[test]
fn psf_loss_of_traced_rays() {
    for lens in [nominal_triplet(), near(nominal_triplet()), vignetted().0] {
        check_psf_loss(psf_traced_with_tape, &lens, 9.0_f64.to_radians(), 48, 1e-6);
    }
}

#[test]
fn first_order_properties() {
    let lens = nominal_triplet();
    let loss = |l: &Lens| {
        let order = first_order(&l.at_wavelength(l.reference_um));
        order.efl_mm + 0.5 * order.bfl_mm + 3.0 * order.stop_radius_mm
    };
    let mut gradient = LensGradient::zero(7);
    let wish = FirstOrderCotangent { efl: 1.0, bfl: 0.5, stop_radius: 3.0 };
    pull_back_first_order(&lens.at_wavelength(lens.reference_um), wish, &mut gradient);
    check(&lens, &gradient, &loss, &[1.0], 1e-6);

    let lens = near(lens);
    let loss = |l: &Lens| first_order(&l.at_wavelength(l.reference_um)).image_distance_mm;
    let mut gradient = LensGradient::zero(7);
    pull_back_image_distance(&lens.at_wavelength(lens.reference_um), 1.0, &mut gradient);
    check(&lens, &gradient, &loss, &[1.0], 1e-6);

    let mut all = special_lenses();
    all.extend(
        special_lenses().into_iter().map(|lens| Lens { object: ObjectDistance::Finite(300.0), ..lens }),
    );
    for lens in all {
        let sequence = lens.at_wavelength(lens.reference_um);
        let loss = |l: &Lens| {
            let sequence = l.at_wavelength(l.reference_um);
            let order = first_order(&sequence);
            order.image_distance_mm
                + 3.0 * order.stop_radius_mm
                + 2.0 * image_height_per_tangent(&sequence)
                + 5.0 * image_brightness(&sequence).ln()
        };
        let mut gradient = LensGradient::zero(lens.surfaces.len());
        pull_back_image_distance(&sequence, 1.0, &mut gradient);
        pull_back_first_order(
            &sequence,
            FirstOrderCotangent { stop_radius: 3.0, ..Default::default() },
            &mut gradient,
        );
        pull_back_image_height(&sequence, 2.0, &mut gradient);
        pull_back_log_brightness(&sequence, 5.0, &mut gradient);
        check(&lens, &gradient, &loss, &[1.0, 10.0], 1e-6);
        // A field close to the axis is imaged where first-order optics says, on the paraxial image plane.
        let focused = with_paraxial_focus(&lens, 0.0);
        if focused.is_rotationally_symmetric() {
            let sequence = focused.at_wavelength(focused.reference_um);
            let field = 1e-5_f64;
            let real = chief_ray(&sequence, field).unwrap().y_mm;
            let ideal = image_height_per_tangent(&sequence) * field.tan();
            assert!((real / ideal - 1.0).abs() < 1e-6, "{}: {real} {ideal}", lens.name);
        }
    }
}

#[test]
fn clearances() {
    let lens = nominal_triplet();
    let limits = Limits {
        element_edge_mm: Some(6.0),
        element_centre_mm: Some(6.0),
        air_gap_mm: Some(4.0),
        ..Limits::default()
    };
    let mut constraints = limits.constraints(&lens, 0.0);
    constraints.push(Constraint::ImageDistance { least_mm: 30.0 });
    let (value, gradient) = penalty(&constraints, &lens).unwrap();
    assert!(value > 1.0);
    // The semi-diameter is where the edge is measured, not a variable of the penalty.
    let mut lens = lens;
    lens.entrance_pupil_mm = 5.7;
    let loss = |l: &Lens| penalty(&constraints, &with_radii_of(&lens, l)).unwrap().0;
    check(&lens, &gradient, &loss, &[1.0], 1e-6);
}

/// A lens with the clear radii of another: there constraints are measured, and no penalty moves them.
fn with_radii_of(clear: &Lens, lens: &Lens) -> Lens {
    let mut same = lens.clone();
    for (a, b) in same.surfaces.iter_mut().zip(&clear.surfaces) {
        a.semi_diameter_mm = b.semi_diameter_mm;
    }
    same
}

#[test]
fn radius_and_field_of_view() {
    let lens = nominal_triplet();
    let of_radius = |l: &Lens, surface: usize, radius_mm: [f64; 2]| {
        penalty(&[Constraint::SolvedRadius { surface, radius_mm }], l).unwrap()
    };
    let loss = |l: &Lens| {
        let same = with_radii_of(&lens, l);
        of_radius(&same, 6, [-12.5, -11.0]).0 + of_radius(&same, 1, [12.0, 14.0]).0
    };
    let (low, mut gradient) = of_radius(&lens, 6, [-12.5, -11.0]);
    let (high, other) = of_radius(&lens, 1, [12.0, 14.0]);
    gradient += &other;
    // The sag at the clear radius between the shape and that of the bound, which is 1e-4 of the width inside.
    let sag_mm2 = |surface: usize, bound_mm: f64, other_mm: f64| {
        let surface = &lens.surfaces[surface];
        let inside = 1e-4 * (1.0 / bound_mm - 1.0 / other_mm).abs();
        let beyond = (surface.shape.curvature - 1.0 / bound_mm).abs() + inside;
        (0.5 * surface.semi_diameter_mm.powi(2) * beyond).powi(2)
    };
    let of_low = sag_mm2(6, -12.5, -11.0);
    assert!((low / of_low - 1.0).abs() < 1e-9 && low > 1e-4, "{low} {of_low}");
    let of_high = sag_mm2(1, 12.0, 14.0);
    assert!((high / of_high - 1.0).abs() < 1e-9 && high > 1e-4, "{high} {of_high}");
    check(&lens, &gradient, &loss, &[1.0], 1e-6);
    assert_eq!(of_radius(&lens, 6, [-15.05, -11.5]).0, 0.0);

    let field = 14.0_f64.to_radians();
    let at = |l: &Lens, wanted_mm: f64| {
        penalty(&[Constraint::ChiefHeight { field_rad: field, wanted_mm, tolerance_mm: 0.02 }], l).unwrap()
    };
    for wanted in [5.0, 6.5] {
        let (value, gradient) = at(&lens, wanted);
        assert!(value > 0.01);
        check(&lens, &gradient, &|l: &Lens| at(l, wanted).0, &[1.0], 1e-6);
    }
    let held = chief_ray(&lens.at_wavelength(lens.reference_um), field).unwrap().y_mm;
    assert_eq!(at(&lens, held + 0.019).0, 0.0);
}

/// Compares the derivatives of a spot by the free coordinates of a space with central differences, for the lens as drawn and for one with errors;
/// returns how many there are.
fn check_coordinates(space: &SmoothSpace) -> usize {
    let fields = [0.1];
    let x = space.start().to_vec();
    let errors: Vec<f64> = space
        .ranges()
        .iter()
        .zip([2e-3, -1e-3].into_iter().cycle())
        .map(|(range, share)| share * range)
        .collect();
    for errors in [Vec::new(), errors] {
        let at = space.lens_off(&x, &errors).unwrap();
        let (_, gradient) = mean_square_spot(&at, &fields).unwrap();
        let analytic = space.pull_back_off(&x, &errors, &at, &gradient);
        for i in 0..x.len() {
            let value = |h: f64| {
                let mut moved = x.clone();
                moved[i] += h;
                mean_square_spot(&space.lens_off(&moved, &errors).unwrap(), &fields).unwrap().0
            };
            let h = 1e-5;
            let numeric = (8.0 * (value(h) - value(-h)) - (value(2.0 * h) - value(-2.0 * h))) / (12.0 * h);
            let relative = (analytic[i] - numeric).abs() / numeric.abs();
            assert!(relative < 1e-6, "coordinate {i}: {} against {numeric}", analytic[i]);
        }
    }
    assert_ne!(space.lens_off(&x, &errors_of_one(space)).unwrap(), space.lens_at(&x).unwrap());
    x.len()
}

/// An error of the first coordinate alone.
fn errors_of_one(space: &SmoothSpace) -> Vec<f64> {
    vec![1e-3 * space.ranges()[0]]
}

/// A pickup and a length solve: what follows moves with what it follows, and back.
#[test]
fn free_coordinates_with_pickups_and_a_length() {
    let mut lens = nominal_triplet();
    lens.surfaces[5].shape.departure = Departure::Odd([0.0, 1e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let variable = |surface, number, min, max| Variable { surface, number, min, max };
    let space = DesignSpace::new(
        lens.clone(),
        vec![
            variable(2, Number::Curvature, -60.0, -20.0),
            variable(1, Number::Thickness, 4.58, 10.11),
            variable(5, Number::Departure(1), -1e-3, 1e-3),
        ],
        vec![Pickup { surface: 3, variable: 0, scale: -1.0, offset: 0.0 }],
        Solves {
            efl: Some(EflSolve { surface: 6, efl_mm: 25.0, radius_mm: None }),
            length: Some((3, 22.0)),
            ..Solves::default()
        },
        Focus::Paraxial { range_mm: 0.5 },
    )
    .and_then(SmoothSpace::new)
    .unwrap();
    let at = space.lens_at(space.start()).unwrap();
    assert_eq!(at.surfaces[3].shape.curvature, -at.surfaces[2].shape.curvature);
    assert!((at.total_track_mm() - at.image_distance_mm() - 22.0).abs() < 1e-12);
    assert_eq!(check_coordinates(&space), 4);
    let far = Solves { length: Some((9, 1.0)), ..Solves::default() };
    let gone = DesignSpace::new(lens, Vec::new(), Vec::new(), far, Focus::Fixed);
    assert!(gone.is_err());
}

#[test]
fn free_coordinates_with_solves() {
    let lens = nominal_triplet();
    let variable = |surface, number, min, max| Variable { surface, number, min, max };
    let space = DesignSpace::new(
        lens.clone(),
        vec![
            variable(0, Number::Curvature, 9.85, 14.98),
            variable(0, Number::Conic, -0.49, 0.29),
            variable(1, Number::Thickness, 4.58, 10.11),
            variable(5, Number::Asphere(0), -4.99e-3, 4.99e-3),
            variable(5, Number::Asphere(4), -2.33e-8, 8.8e-10),
        ],
        Vec::new(),
        Solves { efl: Some(EflSolve { surface: 6, efl_mm: 25.0, radius_mm: None }), ..Solves::default() },
        Focus::Paraxial { range_mm: 0.5 },
    )
    .and_then(SmoothSpace::new)
    .unwrap();
    let at = space.lens_at(space.start()).unwrap();
    let order = first_order(&at.at_wavelength(at.reference_um));
    assert!((order.efl_mm - 25.0).abs() < 1e-10);
    assert_eq!(check_coordinates(&space), 6);
}

/// The magnification and the aperture of a near object hold, and everything follows them.
#[test]
fn free_coordinates_of_a_near_object() {
    let near = Lens { object: ObjectDistance::Finite(120.0), ..nominal_triplet() };
    let lens = with_paraxial_focus(&near, 0.0);
    let variable = |surface, number, min, max| Variable { surface, number, min, max };
    let solves = Solves {
        magnification: Some(MagnificationSolve { surface: 6, magnification: -0.25, radius_mm: None }),
        marginal_tangent: Some(0.02),
        ..Solves::default()
    };
    let variables = vec![
        variable(0, Number::Curvature, 9.85, 14.98),
        variable(1, Number::Thickness, 4.58, 10.11),
        variable(5, Number::Curvature, 12.0, 20.0),
    ];
    let space = DesignSpace::new(lens, variables, Vec::new(), solves, Focus::Paraxial { range_mm: 0.5 })
        .and_then(SmoothSpace::new)
        .unwrap();
    let at = space.lens_at(space.start()).unwrap();
    let order = first_order(&at.at_wavelength(at.reference_um));
    assert!((first_order_table(&at).magnification.unwrap() + 0.25).abs() < 1e-12);
    let tangent = 0.5 * at.entrance_pupil_mm / (120.0 + order.entrance_pupil_at_mm);
    assert!((tangent / 0.02 - 1.0).abs() < 1e-12);
    assert_eq!(check_coordinates(&space), 4);
}

/// Decentres and tilts are coordinates as any other number.
#[test]
fn free_coordinates_of_a_placement() {
    let lens = special_lenses().into_iter().find(|l| l.name == "tilted and decentred").unwrap();
    let around = |surface: usize, number: Number, range: f64| {
        let value = number.read_stated(&lens, surface);
        Variable { surface, number, min: value - range, max: value + 0.7 * range }
    };
    let variables = vec![
        around(1, Number::Decenter(0), 0.1),
        around(6, Number::Decenter(1), 0.1),
        around(1, Number::Tilt(0), 0.5),
        around(6, Number::Tilt(1), 0.5),
        around(0, Number::Curvature, 2.0),
    ];
    let solves =
        Solves { efl: Some(EflSolve { surface: 6, efl_mm: 25.0, radius_mm: None }), ..Solves::default() };
    let pickups = vec![Pickup { surface: 4, variable: 2, scale: 0.3, offset: 0.0 }];
    let space = DesignSpace::new(lens.clone(), variables, pickups, solves, Focus::Paraxial { range_mm: 0.5 })
        .and_then(SmoothSpace::new)
        .unwrap();
    assert_eq!(check_coordinates(&space), 6);
}

/// Steps go past a bound, behind which the number comes back inside: the lens is still the same when the next stage begins.
#[test]
fn a_coordinate_past_a_bound_is_taken_back_to_the_same_lens() {
    let lens = nominal_triplet();
    let variables = vec![Variable { surface: 1, number: Number::Thickness, min: 4.58, max: 10.11 }];
    let space = DesignSpace::new(lens, variables, Vec::new(), Solves::default(), Focus::Fixed)
        .and_then(SmoothSpace::new)
        .unwrap();
    let thickness = |x: f64| space.lens_at(&[x]).unwrap().surfaces[1].thickness_mm;
    for x in [0.3, 1.55, 2.2, -4.0, 5.7] {
        let back = space.off_bounds(&[x])[0];
        assert!(back.abs() < 1.5509 && (thickness(back) - thickness(x)).abs() < 1e-12, "{x} {back}");
    }
    assert_eq!(space.off_bounds(&[0.3]), [0.3]);
    assert!((thickness(space.off_bounds(&[1.57])[0]) - thickness(1.57)).abs() < 1e-3);
}

/// The backward pass through a space is the transpose of its slopes, whatever is solved for.
#[test]
fn pulling_back_through_a_space_transposes_its_slopes() {
    let mut lens = special_lenses().into_iter().find(|l| l.name == "tilted and decentred").unwrap();
    let variables: Vec<Variable> = [
        (0, Number::Curvature),
        (2, Number::Curvature),
        (1, Number::Thickness),
        (4, Number::Thickness),
        (5, Number::Asphere(1)),
        (5, Number::Conic),
        (6, Number::Decenter(0)),
        (4, Number::Tilt(2)),
        (6, Number::Thickness),
    ]
    .map(|(surface, number)| {
        let value = number.read_stated(&lens, surface);
        Variable { surface, number, min: value - 1.0, max: value + 1.0 }
    })
    .to_vec();
    let pickups = vec![
        Pickup { surface: 3, variable: 1, scale: -0.9, offset: 1e-3 },
        Pickup { surface: 0, variable: 3, scale: 0.5, offset: 0.1 },
    ];
    let efl = Some(EflSolve { surface: 5, efl_mm: 25.5, radius_mm: None });
    for object in [ObjectDistance::Infinity, ObjectDistance::Finite(300.0)] {
        lens.object = object;
        // A near object may have a magnification and an aperture to keep.
        let is_near = object != ObjectDistance::Infinity;
        let kept = is_near.then(|| Solves {
            magnification: Some(MagnificationSolve { surface: 5, magnification: -0.1, radius_mm: None }),
            marginal_tangent: Some(0.01),
            ..Solves::default()
        });
        let of_focal_length = Solves { efl, ..Solves::default() };
        for solves in [Some(Solves::default()), Some(of_focal_length), kept].into_iter().flatten() {
            for length in [None, Some((3, 22.0))] {
                for focus in [Focus::Fixed, Focus::Free, Focus::Paraxial { range_mm: 5.0 }] {
                    let solves = Solves { length, ..solves };
                    let space = (lens.clone(), variables.clone(), pickups.clone());
                    let space = DesignSpace::new(space.0, space.1, space.2, solves, focus).unwrap();
                    let mapped = space.map(&space.start()).unwrap();
                    let mut gradient = LensGradient::zero(lens.surfaces.len());
                    let mut noise = (0..).map(|i| (f64::from(i) * 0.618_033_988_7).fract() - 0.5);
                    for (surface, number) in space.numbers() {
                        gradient[(*surface, *number)] = noise.next().unwrap();
                    }
                    gradient.entrance_pupil = noise.next().unwrap();
                    let found = space.pull_back(&mapped.lens, &gradient);
                    for (c, found) in found.into_iter().enumerate() {
                        // The last thickness may be there twice: as a variable without effect, and as the image distance.
                        let terms = space
                            .numbers()
                            .iter()
                            .enumerate()
                            .map(|(row, n)| mapped.slopes[(row, c)] * gradient[*n]);
                        let by_pupil = mapped.pupil_slopes[c] * gradient.entrance_pupil;
                        let terms = terms.chain([by_pupil]);
                        let (expected, size) = terms.fold((0.0, 0.0), |(s, a), t| (s + t, a + t.abs()));
                        assert!(
                            (found - expected).abs() < 1e-12 * size.max(1.0),
                            "{focus:?} {c}: {found} {expected}"
                        );
                    }
                }
            }
        }
    }
}

/// A merit by residuals: its gradient against central differences, and its normal equations against both.
#[test]
fn spot_residuals() {
    let chosen = ["tilted and decentred", "toroid", "binary"];
    let special = special_lenses().into_iter().filter(|l| chosen.contains(&l.name.as_str()));
    for lens in special.chain([nominal_triplet()]) {
        for power in [1.0, 2.0, 4.0] {
            let merit = SpotResiduals {
                power,
                fields_rad: vec![0.05, 0.2],
                field_weights: vec![1.0, 0.5],
                ..SpotResiduals::new(&lens)
            };
            let (value, gradient) = merit.with_gradient(&lens).unwrap();
            let gradient = gradient.unwrap();
            assert_eq!(merit.value(&lens), Some(value));
            check(&lens, &gradient, &|l: &Lens| merit.value(l).unwrap(), &[0.3, 1.0, 10.0], 1e-6);

            let numbers: Vec<(usize, Number)> = (0..lens.surfaces.len())
                .flat_map(|i| [(i, Number::Curvature), (i, Number::Thickness), (i, Number::Asphere(1))])
                .collect();
            let gram = merit.normal_equations(&lens, &numbers).unwrap();
            let (stop, residual) = (numbers.len(), numbers.len() + 1);
            assert!((gram[(residual, residual)] / (value * value) - 1.0).abs() < 1e-9);
            // Half the gradient of the square, the stop following the entrance pupil.
            let sequence = lens.at_wavelength(lens.reference_um);
            let radius = first_order(&sequence).stop_radius_mm;
            let mut by_stop = LensGradient::zero(lens.surfaces.len());
            let bars = FirstOrderCotangent { stop_radius: 1.0 / radius, ..Default::default() };
            pull_back_first_order(&sequence, bars, &mut by_stop);
            for (n, number) in numbers.iter().enumerate() {
                let found = gram[(n, residual)] + gram[(stop, residual)] * by_stop[*number];
                let expected = value * gradient[*number];
                assert!(
                    (found - expected).abs() < 1e-8 * expected.abs().max(1e-3),
                    "{} {number:?}: {found} {expected}",
                    lens.name
                );
            }
        }
    }
}
