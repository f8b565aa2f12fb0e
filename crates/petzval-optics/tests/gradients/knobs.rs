//! Every number of a lens, and the comparison of its derivative with central differences.

use petzval_optics::glass::{Dispersion, Glass};
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::{Action, Departure, Lens};
use petzval_optics::number::Number;

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
pub fn shift_index(lens: &mut Lens, surface: usize, h: f64) {
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
pub fn check(
    lens: &Lens,
    gradient: &LensGradient,
    loss: &dyn Fn(&Lens) -> f64,
    steps: &[f64],
    tolerance: f64,
) {
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
