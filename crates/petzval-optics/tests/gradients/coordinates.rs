//! Free coordinates of design spaces.

use crate::common::{nominal_triplet, special_lenses};
use petzval_optics::analysis::first_order_table;
use petzval_optics::design_space::{
    DesignSpace, EflSolve, Focus, MagnificationSolve, Pickup, SmoothSpace, Solves, Variable,
};
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::{Departure, Lens, ObjectDistance};
use petzval_optics::number::Number;
use petzval_optics::paraxial::first_order;
use petzval_optics::solve::with_paraxial_focus;
use petzval_optics::spot::mean_square_spot;

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
    // A negative tangent is that of a lens whose pupil stood behind the object when it was taken, and has gone through infinity since.
    for held in [0.02, -0.02] {
        let solves = Solves {
            magnification: Some(MagnificationSolve { surface: 6, magnification: -0.25, radius_mm: None }),
            marginal_tangent: Some(held),
            ..Solves::default()
        };
        let variables = vec![
            variable(0, Number::Curvature, 9.85, 14.98),
            variable(1, Number::Thickness, 4.58, 10.11),
            variable(5, Number::Curvature, 12.0, 20.0),
        ];
        let focus = Focus::Paraxial { range_mm: 0.5 };
        let space = DesignSpace::new(lens.clone(), variables, Vec::new(), solves, focus)
            .and_then(SmoothSpace::new)
            .unwrap();
        let at = space.lens_at(space.start()).unwrap();
        let order = first_order(&at.at_wavelength(at.reference_um));
        assert!((first_order_table(&at).magnification.unwrap() + 0.25).abs() < 1e-12);
        let tangent = 0.5 * at.entrance_pupil_mm / (120.0 + order.entrance_pupil_at_mm);
        assert!((tangent / 0.02 - 1.0).abs() < 1e-12, "{held}: {tangent}");
        assert_eq!(check_coordinates(&space), 4);
    }
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
