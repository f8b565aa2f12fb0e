//! Tolerances: gradients of merits against central differences, rigid motions against a tracer in fixed coordinates, and random
//! lenses against what the sensitivities say of them.

mod common;

use common::{nominal_triplet, special_lenses};
use petzval_files::{parse_tolerances, write_tolerances};
use petzval_optics::lens::{Lens, ObjectDistance, Placement, Surface, SurfaceShape, validate};
use petzval_optics::merit::{Better, FieldSet, Merit, Mtf, RmsSpot, RmsWavefront};
use petzval_optics::number::Number;
use petzval_optics::paraxial::first_order;
use petzval_optics::psf::PsfKind;
use petzval_optics::pupil::Quadrature;
use petzval_optics::spot::mean_square_spot_traced;
use petzval_optics::tolerance::{
    Distribution, Failure, Freedom, Grade, Perturbation, Quantity, RigidMotion, Study, ToleranceError,
    Tolerances, default_tolerances, draw, elements, inverse, monte_carlo, moved_rigidly, sensitivities,
};
use petzval_optics::trace::{Ray, trace_ray};

fn off_by(freedom: Freedom, tolerance: f64) -> Perturbation {
    Perturbation { freedom, tolerance, distribution: Distribution::Normal }
}

fn of_surface(quantity: Quantity, surface: usize, tolerance: f64) -> Perturbation {
    off_by(Freedom::of_surface(quantity, surface), tolerance)
}

/// One of everything.
fn one_of_everything() -> Vec<Perturbation> {
    use Quantity::{
        Conic, DecenterX, DecenterY, Form, Index, Irregularity, Power, Radius, RadiusPercent, Shift,
        Thickness, TiltX, TiltY,
    };
    let mut all = vec![
        of_surface(Radius, 0, 0.02),
        of_surface(RadiusPercent, 2, 0.2),
        of_surface(Power, 3, 3.0),
        of_surface(Power, 4, 3.0),
        of_surface(Conic, 5, 0.01),
        of_surface(Irregularity, 1, 0.5),
        of_surface(Form(6), 6, 0.2),
        of_surface(Thickness, 1, 0.03),
        of_surface(Thickness, 5, 0.03),
        of_surface(Thickness, 6, 0.03),
        of_surface(Index, 2, 5e-4),
    ];
    for (quantity, tolerance) in [(DecenterX, 0.02), (DecenterY, 0.02), (TiltX, 2.0), (TiltY, 2.0)] {
        all.push(of_surface(quantity, 6, tolerance));
        all.push(off_by(Freedom::of_element(quantity, 2, 3), tolerance));
        all.push(off_by(Freedom::of_element(quantity, 0, 3), tolerance));
    }
    all.push(off_by(Freedom::of_element(Shift, 2, 3), 0.02));
    all
}

/// Derivatives by every perturbation against central differences of the merit of made lenses, at `share` of the tolerances; of
/// several steps the one that fits best counts. `rounding` is the share of the merit by which it repeats where a lens changes in
/// the last bits: what a difference cannot show. Derivatives below a thousandth of the largest count as that.
fn check_derivatives(lens: &Lens, merit: &dyn Merit, share: f64, steps: &[f64], rounding: f64) {
    let tolerances = Tolerances { perturbations: one_of_everything(), compensators: Vec::new() };
    let study = Study::new(lens, &tolerances, merit).unwrap();
    let signs = |i: usize| if i.is_multiple_of(3) { -1.0 } else { 1.0 };
    let off: Vec<f64> =
        tolerances.perturbations.iter().enumerate().map(|(i, p)| share * signs(i) * p.tolerance).collect();
    let made = study.make(&off).unwrap();
    let derivatives = study.derivatives(&off, &made);
    let largest = derivatives
        .iter()
        .zip(&tolerances.perturbations)
        .fold(0.0_f64, |m, (by, p)| m.max((by.unwrap() * p.tolerance).abs()));
    for (i, (by, p)) in derivatives.iter().zip(&tolerances.perturbations).enumerate() {
        let at = |moved: f64| {
            let mut off = off.clone();
            off[i] += moved * p.tolerance;
            study.make(&off).unwrap().value
        };
        let exact = by.unwrap() * p.tolerance;
        let numeric = |step: &f64| {
            let h = *step;
            (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h)
        };
        let error = |step: &f64| (numeric(step) - exact).abs() - rounding * made.value.abs() / step;
        let best = steps.iter().map(error).fold(f64::INFINITY, f64::min);
        assert!(
            best < 1e-5 * exact.abs().max(1e-3 * largest),
            "{}, {}: {exact:e}, differences {:?}",
            merit.name(),
            p.freedom.name(),
            steps.iter().map(numeric).collect::<Vec<_>>()
        );
    }
}

/// The triplet, and one whose surfaces are shifted and turned already.
fn two_lenses() -> [Lens; 2] {
    let turned = special_lenses().into_iter().find(|l| l.name == "tilted and decentred").unwrap();
    [nominal_triplet(), turned]
}

#[test]
fn derivatives_of_the_rms_spot() {
    for lens in two_lenses() {
        // Fields on one side, so that decentres and tilts have a slope.
        let merit = RmsSpot { fields: FieldSet::new(&lens, &[0.0, 8.0, 14.0]), ..RmsSpot::new(&lens) };
        for share in [0.0, 1.0] {
            check_derivatives(&lens, &merit, share, &[1e-2, 3e-2, 1e-1], 1e-13);
        }
    }
}

#[test]
fn derivatives_of_the_geometric_mtf() {
    for lens in two_lenses() {
        let fields = FieldSet::new(&lens, &[5.0, 12.0]);
        // Splatted light has a slope everywhere but no curvature; finer pupil cells smooth what a difference sees of that.
        let fine = Quadrature::grid(256).unwrap();
        let merit = Mtf::new(&lens, 30.0, PsfKind::Geometric).with_fields(fields).with_quadrature(fine);
        check_derivatives(&lens, &merit, 0.5, &[1e-3, 3e-3, 1e-2, 3e-2], 2e-11);
    }
}

#[test]
fn derivatives_of_the_mtf_by_diffraction() {
    let mut lens = nominal_triplet();
    lens.wavelengths_um = vec![0.55];
    let merit = Mtf::new(&lens, 60.0, PsfKind::Diffraction).with_fields(FieldSet::new(&lens, &[3.0]));
    check_derivatives(&lens, &merit, 0.0, &[3e-3, 1e-2, 3e-2, 1e-1], 2e-11);
}

#[test]
fn derivatives_of_the_rms_wavefront_error() {
    for lens in two_lenses() {
        for share in [0.0, 1.0] {
            // The grid of directions grows in steps; these fields are not at one, where differences would see 1e-7 waves of its error.
            let merit = RmsWavefront { fields: FieldSet::new(&lens, &[3.0, 8.0]) };
            check_derivatives(&lens, &merit, share, &[3e-3, 1e-2, 3e-2, 1e-1], 2e-11);
        }
    }
}

#[test]
fn the_gradient_of_both_sides_is_that_of_their_mean() {
    let lens = nominal_triplet();
    let merit = RmsSpot::new(&lens);
    let mut turned = lens.clone();
    turned.surfaces[2].placement = Some(Placement::default());
    let (value, gradient) = merit.with_gradient(&turned).unwrap();
    assert!((merit.value(&lens).unwrap() / value - 1.0).abs() < 1e-14);
    let g = gradient.unwrap();
    for number in (0..2).map(Number::Decenter).chain((0..3).map(Number::Tilt)) {
        assert_eq!(g[(2, number)], 0.0, "{number}");
    }
    // The least tilt makes every field of both sides count; the value must go over smoothly.
    turned.surfaces[2].placement = Some(Placement { tilt_rad: [1e-9, 0.0, 0.0], ..Placement::default() });
    assert!((merit.value(&turned).unwrap() / value - 1.0).abs() < 1e-9);
}

/// A lens of spheres in fixed coordinates: vertices, rotations as columns, curvatures, indices behind.
struct Fixed {
    vertex: Vec<[f64; 3]>,
    rotation: Vec<[[f64; 3]; 3]>,
    curvature: Vec<f64>,
    index: Vec<f64>,
}

fn times(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| (0..3).map(|k| m[i][k] * v[k]).sum())
}

fn product(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn turn(tilt: [f64; 2]) -> [[f64; 3]; 3] {
    let ((sx, cx), (sy, cy)) = (tilt[0].sin_cos(), tilt[1].sin_cos());
    product(
        &[[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]],
        &[[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]],
    )
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Fixed {
    fn new(lens: &Lens) -> Self {
        let mut z = 0.0;
        let vertex = lens.surfaces.iter().map(|s| {
            let at = [0.0, 0.0, z];
            z += s.thickness_mm;
            at
        });
        Self {
            vertex: vertex.collect(),
            rotation: vec![turn([0.0; 2]); lens.surfaces.len()],
            curvature: lens.surfaces.iter().map(|s| s.shape.curvature).collect(),
            index: lens.surfaces.iter().map(|s| s.glass.index(0.55)).collect(),
        }
    }

    /// Moves surfaces as one body about the vertex of the first.
    fn moved(&mut self, first: usize, last: usize, shift: [f64; 3], tilt: [f64; 2]) {
        let (q, pivot) = (turn(tilt), self.vertex[first]);
        for s in first..=last {
            let from = [0, 1, 2].map(|k| self.vertex[s][k] - pivot[k]);
            let to = times(&q, from);
            self.vertex[s] = [0, 1, 2].map(|k| pivot[k] + shift[k] + to[k]);
            self.rotation[s] = product(&q, &self.rotation[s]);
        }
    }

    /// Where a ray meets the plane z = `image`.
    fn trace(&self, mut p: [f64; 3], mut d: [f64; 3], image: f64) -> [f64; 3] {
        let mut before = 1.0;
        for s in 0..self.vertex.len() {
            let axis = [0, 1, 2].map(|k| self.rotation[s][k][2]);
            let from = [0, 1, 2].map(|k| p[k] - self.vertex[s][k]);
            let c = self.curvature[s];
            // c |x|^2 = 2 x.axis with x = from + t d, the root next to the vertex.
            let (a, b, e) = (c, c * dot(from, d) - dot(axis, d), c * dot(from, from) - 2.0 * dot(from, axis));
            let t = e / (-b + (b * b - a * e).sqrt());
            p = [0, 1, 2].map(|k| p[k] + t * d[k]);
            let normal = [0, 1, 2].map(|k| axis[k] - c * (p[k] - self.vertex[s][k]));
            let mu = before / self.index[s];
            let cos = dot(normal, d);
            let bend = (1.0 - mu * mu * (1.0 - cos * cos)).sqrt() - mu * cos;
            d = [0, 1, 2].map(|k| mu * d[k] + bend * normal[k]);
            before = self.index[s];
        }
        let t = (image - p[2]) / d[2];
        [0, 1, 2].map(|k| p[k] + t * d[k])
    }
}

/// The triplet with spheres only, behind a plane in the air that stays where it is.
fn spheres() -> Lens {
    let mut lens = nominal_triplet();
    for s in &mut lens.surfaces {
        s.shape.asphere = Default::default();
        s.semi_diameter_mm = 12.0;
    }
    lens.surfaces.insert(0, Surface { thickness_mm: 5.0, semi_diameter_mm: 12.0, ..Surface::default() });
    lens.stop += 1;
    lens
}

fn rays() -> Vec<Ray> {
    [[0.3, -0.4, 0.02, 0.05], [1.1, 0.6, -0.04, 0.1], [-1.4, 1.2, 0.01, -0.08], [0.0, 0.0, 0.0, 0.0]]
        .map(|[x, y, l, m]: [f64; 4]| {
            let n = (1.0 - l * l - m * m).sqrt();
            Ray { position: [x, y, 0.0], direction: [l, m, n] }
        })
        .to_vec()
}

#[test]
fn moved_elements_are_where_fixed_coordinates_put_them() {
    let lens = spheres();
    let image: f64 = lens.surfaces.iter().map(|s| s.thickness_mm).sum();
    // An element, then the group of two that it is part of, then a surface within the group.
    let motions = [
        (3, 4, [0.1, -0.2, 0.05], [0.03, -0.02]),
        (1, 4, [-0.05, 0.08, -0.1], [-0.02, 0.04]),
        (2, 2, [0.02, 0.03, 0.0], [0.01, 0.015]),
        (6, 7, [0.0, 0.1, 0.0], [0.05, 0.0]),
    ];
    let (mut moved, mut fixed) = (lens.clone(), Fixed::new(&lens));
    for (first, last, shift_mm, tilt_rad) in motions {
        moved = moved_rigidly(&moved, first, last, &RigidMotion { shift_mm, tilt_rad });
        fixed.moved(first, last, shift_mm, tilt_rad);
        for ray in rays() {
            let path = trace_ray(&moved.at_wavelength(0.55), ray);
            let [x, y, _] = path.image.expect("a ray that arrives").position;
            let [fx, fy, _] = fixed.trace(ray.position, ray.direction, image);
            assert!((x - fx).hypot(y - fy) < 1e-11, "{first}-{last}: ({x}, {y}), not ({fx}, {fy})");
        }
    }
    assert!((moved.total_track_mm() - image).abs() < 1e-12, "the image plane has moved");
}

#[test]
fn a_concentric_meniscus_may_turn_about_its_centre() {
    let mut lens = spheres();
    let flint = lens.surfaces[3].glass.clone();
    lens.surfaces.truncate(3);
    let round = |radius: f64| SurfaceShape { curvature: 1.0 / radius, ..SurfaceShape::PLANE };
    lens.surfaces[1].shape = round(30.0);
    lens.surfaces[1].thickness_mm = 4.0;
    lens.surfaces[1].glass = flint;
    lens.surfaces[2].shape = round(26.0);
    lens.surfaces[2].thickness_mm = 60.0;
    lens.stop = 0;
    let turned = moved_rigidly(&lens, 1, 2, &RigidMotion::about(30.0, [0.11, -0.07]));
    let about_vertex =
        moved_rigidly(&lens, 1, 2, &RigidMotion { tilt_rad: [0.11, -0.07], ..RigidMotion::default() });
    for ray in rays() {
        let at = |l: &Lens| trace_ray(&l.at_wavelength(0.55), ray).image.unwrap().position;
        let ([x, y, _], [tx, ty, _], [vx, vy, _]) = (at(&lens), at(&turned), at(&about_vertex));
        assert!((x - tx).hypot(y - ty) < 1e-12, "({x}, {y}), not ({tx}, {ty})");
        assert!((x - vx).hypot(y - vy) > 1e-3, "a turn about the vertex does something");
    }
}

#[test]
fn a_near_object_stays_while_the_first_element_is_shifted() {
    let mut lens = nominal_triplet();
    lens.object = ObjectDistance::Finite(300.0);
    let shifted =
        moved_rigidly(&lens, 0, 1, &RigidMotion { shift_mm: [0.0, 0.0, 0.5], ..RigidMotion::default() });
    let ObjectDistance::Finite(distance) = shifted.object else { panic!("a near object") };
    assert!((distance - 300.5).abs() < 1e-12);
    for (now, then) in shifted.fields_deg.iter().zip(&lens.fields_deg) {
        let height = |field: f64, distance: f64| distance * field.to_radians().tan();
        assert!((height(*now, distance) - height(*then, 300.0)).abs() < 1e-12);
    }
    assert!((shifted.surfaces[1].thickness_mm - lens.surfaces[1].thickness_mm + 0.5).abs() < 1e-12);
}

#[test]
fn the_stop_keeps_its_diameter() {
    let lens = nominal_triplet();
    let stop = |l: &Lens| first_order(&l.at_wavelength(l.reference_um)).stop_radius_mm;
    let tolerances = Tolerances {
        perturbations: vec![of_surface(Quantity::Radius, 0, 0.5), of_surface(Quantity::Thickness, 1, 0.3)],
        compensators: Vec::new(),
    };
    let merit = RmsSpot::new(&lens);
    let study = Study::new(&lens, &tolerances, &merit).unwrap();
    let made = study.make(&[0.5, -0.3]).unwrap().lens;
    assert!((stop(&made) - stop(&lens)).abs() < 1e-12);
    assert!((made.entrance_pupil_mm - lens.entrance_pupil_mm).abs() > 1e-3);
}

/// Moments of draws by z-tests: six of them at 4.5 sigma fail by chance less than once in 20,000 times.
#[test]
fn draws_have_the_moments_of_their_distributions() {
    const COUNT: u64 = 40_000;
    for distribution in [Distribution::Uniform, Distribution::Normal, Distribution::Parabolic] {
        let p = Perturbation {
            freedom: Freedom::of_surface(Quantity::Thickness, 0),
            tolerance: 0.5,
            distribution,
        };
        let draws: Vec<f64> = (0..COUNT).map(|trial| draw(&[p], 7, trial)[0]).collect();
        assert!(draws.iter().all(|t| t.abs() <= 0.5));
        let mean = |power: i32| draws.iter().map(|t| t.powi(power)).sum::<f64>() / COUNT as f64;
        let (m2, m4) = (p.sigma().powi(2), distribution.fourth_moment() * 0.5_f64.powi(4));
        let z_mean = mean(1) / (m2 / COUNT as f64).sqrt();
        let z_square = (mean(2) - m2) / ((m4 - m2 * m2) / COUNT as f64).sqrt();
        assert!(z_mean.abs() < 4.5 && z_square.abs() < 4.5, "{distribution:?}: z {z_mean} {z_square}");
        // The fourth moment itself, whose spread is at most that of a coin.
        assert!(
            (mean(4) - m4).abs() < 4.5 * 0.5 * 0.5_f64.powi(4) / (COUNT as f64).sqrt(),
            "{distribution:?}"
        );
    }
    // Places in the list are independent of each other: their products have the mean zero.
    let p = of_surface(Quantity::Thickness, 0, 1.0);
    let product: f64 = (0..COUNT).map(|trial| draw(&[p, p], 7, trial)).map(|t| t[0] * t[1]).sum();
    assert!((product / COUNT as f64).abs() < 4.5 * p.sigma().powi(2) / (COUNT as f64).sqrt());
}

fn focus(lens: &Lens) -> Vec<(Freedom, Option<f64>)> {
    vec![(Freedom::focus(lens), None)]
}

/// Lenses that are a little off: the spread of their merit is what the slopes say.
///
/// The standard deviation of 6,000 draws is good to 1 %, so that five percent are more than five sigma.
#[test]
fn slopes_predict_the_spread_of_small_perturbations() {
    let mut lens = nominal_triplet();
    lens.wavelengths_um = vec![0.55];
    let small = |perturbations: Vec<Perturbation>| -> Vec<Perturbation> {
        perturbations.into_iter().map(|p| Perturbation { tolerance: 0.02 * p.tolerance, ..p }).collect()
    };
    let graded = |distribution| small(default_tolerances(&lens, Grade::Precision, distribution, false));
    let one_sided = RmsSpot { fields: FieldSet::new(&lens, &[0.0, 7.0, 14.0]), ..RmsSpot::new(&lens) };
    let moved: Vec<Perturbation> =
        graded(Distribution::Uniform).into_iter().filter(|p| p.freedom.quantity.is_motion()).collect();
    let cases: [(&str, &dyn Merit, Vec<Perturbation>, bool); 3] = [
        ("everything, focused", &RmsSpot::new(&lens), graded(Distribution::Normal), true),
        ("everything, not focused", &RmsSpot::new(&lens), graded(Distribution::Parabolic), false),
        ("decentres and tilts, one side", &one_sided, moved, true),
    ];
    for (what, merit, perturbations, focused) in cases {
        let compensators = if focused { focus(&lens) } else { Vec::new() };
        let tolerances = Tolerances { perturbations, compensators };
        let study = Study::new(&lens, &tolerances, merit).unwrap();
        let predicted = sensitivities(&study, &|| Ok(())).unwrap().estimate.unwrap();
        let (_, deviation) = monte_carlo(&study, 3, 6000, &|| Ok(())).unwrap().mean_and_deviation();
        let off = predicted.linear_spread / deviation - 1.0;
        assert!(off.abs() < 0.05, "{what}: predicted {}, found {deviation}", predicted.linear_spread);
    }
}

/// The merit of a symmetric lens has no first derivative by decentres and tilts: the second order must predict their effect.
#[test]
fn the_second_order_predicts_what_decentres_do() {
    let mut lens = nominal_triplet();
    lens.wavelengths_um = vec![0.55];
    let all = default_tolerances(&lens, Grade::Precision, Distribution::Uniform, false);
    let perturbations = all.into_iter().filter(|p| p.freedom.quantity.is_motion()).collect();
    let tolerances = Tolerances { perturbations, compensators: focus(&lens) };
    let merit = RmsSpot::new(&lens);
    let study = Study::new(&lens, &tolerances, &merit).unwrap();
    let estimate = sensitivities(&study, &|| Ok(())).unwrap().estimate.unwrap();
    let found = monte_carlo(&study, 5, 3000, &|| Ok(())).unwrap();
    let (mean, deviation) = found.mean_and_deviation();
    let nominal = study.nominal().value;
    assert!(estimate.linear_spread < 1e-6 * nominal, "{estimate:?}");
    // The mean loss is known to 2 %, the spread to some 4 %.
    let loss = (estimate.mean - nominal) / (mean - nominal);
    assert!((loss - 1.0).abs() < 0.1, "mean {mean} of {nominal}, predicted {}", estimate.mean);
    let spread = estimate.standard_deviation / deviation;
    assert!((spread - 1.0).abs() < 0.15, "spread {deviation}, predicted {}", estimate.standard_deviation);
}

#[test]
fn the_same_bits_on_any_number_of_threads_and_for_one_trial_alone() {
    let lens = nominal_triplet();
    let tolerances = Tolerances {
        perturbations: default_tolerances(&lens, Grade::Commercial, Distribution::Normal, false),
        compensators: focus(&lens),
    };
    let merit = RmsSpot::new(&lens);
    let on = |threads: usize| {
        let pool = rayon_pool(threads);
        pool.install(|| {
            let study = Study::new(&lens, &tolerances, &merit).unwrap();
            monte_carlo(&study, 11, 24, &|| Ok(())).unwrap()
        })
    };
    let (one, two) = (on(1), on(2));
    assert_eq!(one, two);
    let study = Study::new(&lens, &tolerances, &merit).unwrap();
    let worst = one.worst(1)[0];
    let again = study.make(&study.draw(11, worst as u64)).unwrap();
    assert_eq!(Some(again.value), one.trials[worst].value);
    assert_eq!(again.compensators, one.trials[worst].compensators);
    let other_seed = monte_carlo(&study, 12, 24, &|| Ok(())).unwrap();
    assert!(one.trials.iter().zip(&other_seed.trials).all(|(a, b)| a.value != b.value));
}

fn rayon_pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
}

/// Least of a function between two places by golden sections.
fn golden(f: &dyn Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let share = 0.5 * (5.0_f64.sqrt() - 1.0);
    while high - low > 1e-7 {
        let (a, b) = (high - share * (high - low), low + share * (high - low));
        if f(a) < f(b) { high = b } else { low = a }
    }
    0.5 * (low + high)
}

#[test]
fn compensators_reach_the_best_place() {
    let lens = nominal_triplet();
    let perturbations = default_tolerances(&lens, Grade::Commercial, Distribution::Normal, false);
    let tolerances = Tolerances { perturbations, compensators: focus(&lens) };
    let rms = RmsSpot::new(&lens);
    let mtf = Mtf::new(&lens, 20.0, PsfKind::Geometric).with_fields(FieldSet::new(&lens, &[0.0, 6.0]));
    let merits: [(&dyn Merit, usize, f64); 2] = [(&rms, 6, 1e-6), (&mtf, 2, 3e-5)];
    for (merit, trials, accuracy) in merits {
        let study = Study::new(&lens, &tolerances, merit).unwrap();
        for trial in 0..trials {
            let off = study.draw(2, trial as u64);
            let made = study.make(&off).unwrap();
            let cost = |moved: f64| {
                let lens = made.lens.with_image_distance(made.lens.image_distance_mm() + moved);
                let value = merit.value(&lens).unwrap();
                if merit.better() == Better::Lower { value } else { -value }
            };
            let away = golden(&cost, -0.05, 0.05);
            assert!(cost(0.0) - cost(away) < 1e-8 * made.value, "{} off focus by {away} mm", merit.name());
            // The slope is zero: a thickness behind the lens as a perturbation would have none.
            let slope = (cost(1e-3) - cost(-1e-3)) / 2e-3;
            let bend = (cost(1e-2) + cost(-1e-2) - 2.0 * cost(0.0)) / 1e-4;
            assert!(slope.abs() < accuracy.max(1e-3) * bend, "{}: slope {slope}, bend {bend}", merit.name());
        }
    }
}

/// A merit without its gradient.
struct ValueAlone<'a>(&'a dyn Merit);

impl Merit for ValueAlone<'_> {
    fn name(&self) -> String {
        self.0.name()
    }

    fn unit(&self) -> &str {
        self.0.unit()
    }

    fn better(&self) -> Better {
        self.0.better()
    }

    fn value(&self, lens: &Lens) -> Option<f64> {
        self.0.value(lens)
    }
}

#[test]
fn a_merit_without_gradient_is_compensated_alike() {
    let lens = nominal_triplet();
    let of_element = |quantity| (Freedom::of_element(quantity, 5, 6), Some(0.2));
    let compensators =
        vec![(Freedom::focus(&lens), None), of_element(Quantity::DecenterX), of_element(Quantity::DecenterY)];
    let perturbations = vec![
        off_by(Freedom::of_element(Quantity::TiltX, 0, 1), 8.0),
        off_by(Freedom::of_element(Quantity::DecenterX, 2, 3), 0.05),
        of_surface(Quantity::Abbe, 2, 1.0),
    ];
    let rms = RmsSpot::new(&lens);
    let plain = ValueAlone(&rms);
    let tolerances = Tolerances { perturbations: perturbations.clone(), compensators };
    let (by_gradient, by_values) =
        (Study::new(&lens, &tolerances, &rms).unwrap(), Study::new(&lens, &tolerances, &plain).unwrap());
    let alone = Tolerances { perturbations, compensators: focus(&lens) };
    let focused = Study::new(&lens, &alone, &rms).unwrap();
    for trial in 0..3 {
        let off = by_gradient.draw(9, trial);
        let (a, b) = (by_gradient.make(&off).unwrap(), by_values.make(&off).unwrap());
        assert!((a.value / b.value - 1.0).abs() < 1e-7, "{} {}", a.value, b.value);
        for (a, b) in a.compensators.iter().zip(&b.compensators) {
            assert!((a - b).abs() < 1e-4, "{a} {b}");
        }
        // More to set is never worse.
        assert!(a.value <= focused.make(&off).unwrap().value * (1.0 + 1e-9));
    }
}

#[test]
fn the_yield_falls_as_requirements_tighten() {
    let lens = nominal_triplet();
    let tolerances = Tolerances {
        perturbations: default_tolerances(&lens, Grade::Commercial, Distribution::Uniform, false),
        compensators: focus(&lens),
    };
    let merit = RmsSpot::new(&lens);
    let study = Study::new(&lens, &tolerances, &merit).unwrap();
    let found = monte_carlo(&study, 1, 60, &|| Ok(())).unwrap();
    let curve = found.yield_curve();
    assert_eq!(curve.len(), 60);
    assert!(curve.windows(2).all(|w| w[0].0 <= w[1].0 && w[0].1 < w[1].1));
    assert!((curve[59].1 - 1.0).abs() < 1e-15);
    for (value, share) in &curve {
        assert!((found.yield_at(*value) - share).abs() < 1e-12);
    }
    let [low, middle, high] = [10.0, 50.0, 90.0].map(|p| found.percentile(p).unwrap());
    assert!(low < middle && middle < high);
    assert_eq!(found.percentile(0.0), Some(curve[0].0));
    assert_eq!(found.percentile(100.0), Some(curve[59].0));
    let worst = found.worst(3);
    assert_eq!(found.trials[worst[0]].value, Some(curve[59].0));
}

/// The rays of the merit, against a grid of traced rays, on lenses as they are made.
#[test]
fn the_rays_of_the_merit_are_enough() {
    let lens = nominal_triplet();
    let tolerances = Tolerances {
        perturbations: default_tolerances(&lens, Grade::Commercial, Distribution::Uniform, false),
        compensators: focus(&lens),
    };
    let merit = RmsSpot { fields: FieldSet::new(&lens, &[-15.0, -7.0, 0.0, 10.0]), ..RmsSpot::new(&lens) };
    let study = Study::new(&lens, &tolerances, &merit).unwrap();
    let quadrature = Quadrature::grid(96).unwrap();
    for trial in 0..4 {
        let made = study.make(&study.draw(1, trial)).unwrap();
        let fields = [-15.0, -7.0, 0.0, 10.0].map(f64::to_radians);
        let traced = mean_square_spot_traced(&made.lens, &fields, &quadrature).unwrap().0.sqrt();
        assert!((made.value / traced - 1.0).abs() < 2e-3, "{} of {traced}", made.value);
    }
}

#[test]
fn shared_tolerances_cost_their_share() {
    let mut lens = nominal_triplet();
    lens.wavelengths_um = vec![0.55];
    let perturbations = vec![
        of_surface(Quantity::RadiusPercent, 0, 0.1),
        of_surface(Quantity::Thickness, 3, 1.0),
        off_by(Freedom::of_element(Quantity::DecenterY, 2, 3), 0.01),
        // Behind the lens the focus takes all of it.
        of_surface(Quantity::Thickness, 6, 0.1),
    ];
    let tolerances = Tolerances { perturbations, compensators: focus(&lens) };
    let merit = RmsSpot::new(&lens);
    let study = Study::new(&lens, &tolerances, &merit).unwrap();
    let shared = inverse(&study, 1.0, &|| Ok(())).unwrap();
    for s in &shared[..3] {
        let end = |sign: f64| {
            let mut off = vec![0.0; 4];
            off[s.perturbation] = sign * s.tolerance;
            study.make(&off).unwrap().value - study.nominal().value
        };
        let loss = end(1.0).max(end(-1.0));
        assert!((loss - 0.5).abs() < 1e-3 && !s.is_free, "{s:?}: {loss}");
    }
    assert!(shared[3].is_free);
}

#[test]
fn a_grade_is_complete_and_tighter_than_the_one_before() {
    let lens = nominal_triplet();
    assert_eq!(elements(&lens), [(0, 1), (2, 3), (5, 6)]);
    let of = |grade| default_tolerances(&lens, grade, Distribution::Normal, true);
    let [commercial, precision, high] = [Grade::Commercial, Grade::Precision, Grade::High].map(of);
    let tilts = |all: &[Perturbation]| all.iter().filter(|p| p.freedom.quantity == Quantity::TiltX).count();
    assert_eq!(tilts(&commercial), 6);
    let sum = |all: &[Perturbation], quantity| -> f64 {
        all.iter().filter(|p| p.freedom.quantity == quantity).map(|p| p.tolerance).sum()
    };
    for quantity in
        [Quantity::Thickness, Quantity::Index, Quantity::Abbe, Quantity::DecenterX, Quantity::TiltY]
    {
        let [a, b, c] = [&commercial, &precision, &high].map(|all| sum(all, quantity));
        assert!(a > b && b > c && c > 0.0, "{quantity}: {a} {b} {c}");
    }
    for lens in special_lenses() {
        for p in default_tolerances(&lens, Grade::Commercial, Distribution::Normal, true) {
            p.freedom.check(&lens).unwrap();
        }
    }
}

#[test]
fn what_a_lens_does_not_have_is_refused() {
    let lens = nominal_triplet();
    let says = |freedom: Freedom, on: &Lens| freedom.check(on).unwrap_err().to_string();
    assert_eq!(
        says(Freedom::of_surface(Quantity::Radius, 7), &lens),
        "surface 8 does not exist: the lens has 7 surfaces"
    );
    assert_eq!(says(Freedom::of_surface(Quantity::Radius, 4), &lens), "surface 5 has no radius");
    assert_eq!(says(Freedom::of_surface(Quantity::Index, 1), &lens), "surface 2 has no glass behind it");
    assert!(says(Freedom::of_element(Quantity::Index, 0, 1), &lens).contains("can only be moved"));
    assert!(says(Freedom::of_surface(Quantity::Form(5), 0), &lens).contains("not 5"));
    let breaks = special_lenses().into_iter().find(|l| l.name == "coordinate breaks").unwrap();
    assert!(says(Freedom::of_element(Quantity::TiltX, 2, 3), &breaks).contains("surface 3 leads the axis"));
    let tolerances =
        Tolerances { perturbations: vec![of_surface(Quantity::Radius, 0, 0.0)], compensators: vec![] };
    let merit = RmsSpot::new(&lens);
    let refused = Study::new(&lens, &tolerances, &merit).err();
    assert!(matches!(refused, Some(ToleranceError::NotPositive { .. })));
}

/// A lens whose rays are lost is a result, not a failure.
#[test]
fn lenses_without_an_image_count_as_failed() {
    let lens = nominal_triplet();
    let tolerances =
        Tolerances { perturbations: vec![of_surface(Quantity::Radius, 0, 11.0)], compensators: focus(&lens) };
    let merit = RmsSpot::new(&lens);
    let study = Study::new(&lens, &tolerances, &merit).unwrap();
    let found = monte_carlo(&study, 1, 40, &|| Ok(())).unwrap();
    let table = sensitivities(&study, &|| Ok(())).unwrap();
    assert!(found.failed() > 0 && found.failed() < 40, "{}", found.failed());
    assert_eq!(found.percentile(100.0), None);
    assert!(found.yield_at(1e9) < 1.0);
    // A radius that ends within its clear aperture is no lens of the maker, not even the worst; lenses without an image come first.
    let worst = found.worst(40);
    assert!(found.unbuildable() > 0 && worst.len() == 40 - found.unbuildable());
    assert!(worst.iter().map(|number| found.trials[*number].value.is_some()).is_sorted());
    assert!(table.estimate.is_none());
    assert!(table.rows[0].worst_loss(Better::Lower, table.nominal).is_infinite());
}

/// The seed draws glass thinner than nothing for some lenses. Those fail, and the others are what they are without the check.
#[test]
fn lenses_that_cannot_be_built_count_as_failed_and_leave_others_alone() {
    let lens = nominal_triplet();
    let thick =
        Perturbation { distribution: Distribution::Uniform, ..of_surface(Quantity::Thickness, 0, 5.0) };
    let tolerances = Tolerances { perturbations: vec![thick], compensators: focus(&lens) };
    let merit = RmsSpot::new(&lens);
    let study = Study::new(&lens, &tolerances, &merit).unwrap();
    let found = monte_carlo(&study, 1, 60, &|| Ok(())).unwrap();
    assert!(found.unbuildable() > 0 && found.failed() < 60, "{}", found.unbuildable());
    for (number, trial) in found.trials.iter().enumerate() {
        let Some(made) = study.make(&study.draw(1, number as u64)) else { continue };
        assert_eq!(trial.can_be_built, validate(&made.lens).is_ok(), "lens {number}");
        assert_eq!(trial.value, trial.can_be_built.then_some(made.value), "lens {number}");
    }
    let table = sensitivities(&study, &|| Ok(())).unwrap();
    assert!(table.estimate.is_none());
    let [_, minus] = &table.rows[0].failures;
    assert!(matches!(minus, Some(Failure::CannotBeBuilt(_))), "{minus:?}");
}

/// The air behind surface 4 and 10 mm more, mm: best where parts have passed through each other.
struct LittleAir;

impl Merit for LittleAir {
    fn name(&self) -> String {
        "air".to_owned()
    }

    fn unit(&self) -> &str {
        "mm"
    }

    fn better(&self) -> Better {
        Better::Lower
    }

    fn value(&self, lens: &Lens) -> Option<f64> {
        Some(lens.surfaces[3].thickness_mm + 10.0)
    }
}

#[test]
fn a_compensator_stops_where_parts_touch() {
    let lens = nominal_triplet();
    let tolerances = Tolerances {
        perturbations: vec![of_surface(Quantity::Thickness, 4, 0.1)],
        compensators: vec![(Freedom::of_surface(Quantity::Thickness, 3), None)],
    };
    let study = Study::new(&lens, &tolerances, &LittleAir).unwrap();
    for off in [-0.1, 0.0, 0.1] {
        assert!(validate(&study.make(&[off]).unwrap().lens).is_err());
        let made = study.build(&[off]).unwrap().lens;
        validate(&made).unwrap();
        // The stop between the two elements is no part.
        let air_mm = made.gap_behind_mm(3);
        assert!((0.0..0.2).contains(&air_mm), "{air_mm}");
    }
}

const FILE: &str = r#"grade = "high"
distribution = "parabolic"

[[tolerance]]
surface = 1
radius_mm = 0.02
form_um = { r4 = 0.1, r12 = 0.05 }
index = 0

[[tolerance]]
element = [3, 4]
tilt_arcmin = 1.5
shift_mm = 0.01
distribution = "uniform"

[[compensator]]
surface = 4
parameter = "thickness_mm"
travel = 0.2
"#;

#[test]
fn a_file_overrides_its_grade_and_survives_being_written() {
    let lens = nominal_triplet();
    let file = parse_tolerances(FILE, &lens).unwrap();
    let tolerances = file.tolerances(&lens, true);
    let of = |quantity, first, last| {
        let same: Vec<&Perturbation> = (tolerances.perturbations.iter())
            .filter(|p| p.freedom == Freedom { quantity, first, last })
            .collect();
        assert!(same.len() < 2);
        same.first().map(|p| (p.tolerance, p.distribution))
    };
    // A radius in mm stands for what the grade says in percent or fringes, and a zero for nothing.
    assert_eq!(of(Quantity::Radius, 0, 0), Some((0.02, Distribution::Parabolic)));
    assert_eq!((of(Quantity::RadiusPercent, 0, 0), of(Quantity::Power, 0, 0)), (None, None));
    assert_eq!(of(Quantity::Index, 0, 0), None);
    assert_eq!(of(Quantity::Index, 2, 2), Some((1e-4, Distribution::Parabolic)));
    assert_eq!(of(Quantity::Form(12), 0, 0), Some((0.05, Distribution::Parabolic)));
    assert_eq!(of(Quantity::TiltY, 2, 3), Some((1.5, Distribution::Uniform)));
    assert_eq!(of(Quantity::TiltY, 0, 1), Some((0.5, Distribution::Parabolic)));
    assert_eq!(tolerances.compensators.len(), 2);
    let again = parse_tolerances(&write_tolerances(&tolerances), &lens).unwrap();
    assert_eq!(again.tolerances(&lens, false), tolerances);
}

#[test]
fn mutilated_tolerance_files_never_panic() {
    let lens = nominal_triplet();
    for at in 0..FILE.len() {
        let _ = parse_tolerances(&FILE[..at], &lens);
        for put in ["", "-", "9", "\"", "[", "=", "e400", "\n"] {
            let text = format!("{}{put}{}", &FILE[..at], &FILE[at + 1..]);
            if let Ok(file) = parse_tolerances(&text, &lens) {
                file.tolerances(&lens, true).check(&lens).unwrap();
            }
        }
    }
}
