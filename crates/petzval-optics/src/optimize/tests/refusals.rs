//! Problems that are refused.

use super::*;

#[test]
fn pickups_on_what_is_solved_for_are_refused() {
    let mut one = problem();
    one.pickups = vec![Pickup { surface: 6, variable: 0, scale: 1.0, offset: 0.0 }];
    assert!(matches!(one.space().unwrap_err(), DesignSpaceError::Settled { surface: 7, .. }));
    one.pickups = vec![Pickup { surface: 6, variable: 3, scale: 1.0, offset: 0.0 }];
    assert!(matches!(one.space().unwrap_err(), DesignSpaceError::Settled { surface: 7, .. }));
    one.focus = Focus::Fixed;
    one.solves.length = Some((3, 22.1));
    one.pickups = vec![Pickup { surface: 3, variable: 3, scale: 1.0, offset: 0.0 }];
    assert!(matches!(one.space().unwrap_err(), DesignSpaceError::Settled { surface: 4, .. }));
}

#[test]
fn a_variable_that_a_surface_does_not_have_is_refused() {
    let mut problem = problem();
    problem.variables.push(variable(5, Number::Departure(0), -1.0, 1.0));
    let expected = DesignSpaceError::NoSuchNumber { surface: 6, number: Number::Departure(0) };
    assert_eq!(problem.space().unwrap_err(), expected);
}

#[test]
fn impossible_problems_say_why() {
    let base = problem();
    let wrong = |change: &dyn Fn(&mut Problem)| {
        let mut p = base.clone();
        change(&mut p);
        descend(&p, &LevenbergOptions::default(), &mut |_, _, _| true).unwrap_err()
    };
    let error = wrong(&|p| p.variables[0].surface = 9);
    assert_eq!(error, DesignSpaceError::NoSuchSurface { surface: 10, count: 7 });
    let error = wrong(&|p| p.pickups.push(Pickup { surface: 1, variable: 77, scale: 1.0, offset: 0.0 }));
    assert_eq!(error, DesignSpaceError::NoSuchVariable { variable: 78, count: 9 });
    let error = wrong(&|p| p.variables[3].max = p.variables[3].min);
    assert!(matches!(error, DesignSpaceError::Bounds { surface: 2, .. }));
    let error = wrong(&|p| p.solves.efl = Some(EflSolve { surface: 4, efl_mm: 25.0, radius_mm: None }));
    assert!(matches!(error, DesignSpaceError::EflUnsolvable { surface: 5, .. }));
    let error = wrong(&|p| p.base.entrance_pupil_mm = 40.0);
    assert_eq!(error, DesignSpaceError::NoRays);
}
