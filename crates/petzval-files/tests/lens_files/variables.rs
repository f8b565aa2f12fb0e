//! Variables, pickups and solves.

use petzval_files::{Effect, parse_lens, parse_lens_start, write_lens};
use petzval_optics::design_space::{MagnificationSolve, Variable};
use petzval_optics::glass::Catalog;
use petzval_optics::number::Number;

use crate::support::{PLATE, catalog, nominal};

/// Bounds of a tilt are degrees, in a file and in the variable that it becomes; the lens has radians.
#[test]
fn tilts_are_variables_in_degrees() {
    let surface = "label = \"V2 front\"\nplacement = { tilt_deg = [0.0, 1.5, 0.0] }";
    let text = nominal().replace("label = \"V2 front\"", surface);
    let with = |min: f64, max: f64| {
        let bounds = format!("min = {min:?}\nmax = {max:?}\n");
        let variable = format!("[[variable]]\nsurface = 3\nparameter = \"tilt_y_deg\"\n{bounds}\n");
        let at = text.find("[[variable]]").unwrap();
        parse_lens(&format!("{}{variable}{}", &text[..at], &text[at..]), &catalog())
    };
    let file = with(-2.0, 2.0).unwrap();
    assert_eq!(file.variables[0], Variable { surface: 2, number: Number::Tilt(1), min: -2.0, max: 2.0 });
    assert!((file.lens.surfaces[2].placement.unwrap().tilt_rad[1] - 1.5_f64.to_radians()).abs() < 1e-15);
    let again = parse_lens(&write_lens(&file), &catalog()).unwrap();
    assert_eq!(again.variables, file.variables);
    assert_eq!(again.lens, file.lens);
    assert!(with(-1.0, 1.0).unwrap_err().message.contains("outside its bounds"));
    // The offset of a pickup is an angle as well: 0.5 degrees, whatever the factor.
    let follower = "label = \"V2 rear\"\nplacement = { tilt_deg = [0.0, 2.0, 0.0] }";
    let pickup = "[[pickup]]\nsurface = 4\nparameter = \"tilt_y_deg\"\nfollows = 3\noffset = 0.5\n\n";
    let variable = "[[variable]]\nsurface = 3\nparameter = \"tilt_y_deg\"\nmin = -2.0\nmax = 2.0\n\n";
    let text = text.replace("label = \"V2 rear\"", follower);
    let at = text.find("[[variable]]").unwrap();
    let file = parse_lens(&format!("{}{variable}{pickup}{}", &text[..at], &text[at..]), &catalog()).unwrap();
    assert_eq!(file.pickups[0].offset, 0.5_f64.to_radians());
    let written = write_lens(&file);
    assert!(written.contains("\noffset = 0.5\n"), "{written}");
    assert_eq!(parse_lens(&written, &catalog()).unwrap().pickups, file.pickups);
}

#[test]
fn a_curvature_may_vary_through_the_plane() {
    let variable = "[[variable]]\nsurface = 3\nparameter = \"curvature_per_mm\"\nmin = -0.008\nmax = 0.004\n";
    let file = parse_lens(&format!("{PLATE}{variable}"), &catalog()).unwrap();
    let v = file.variables[0];
    assert_eq!((v.surface, v.number, v.min, v.max), (2, Number::Curvature, -125.0, 250.0));
    let written = write_lens(&file);
    assert!(written.contains("parameter = \"curvature_per_mm\"\nmin = -0.008\nmax = 0.004"), "{written}");
    assert_eq!(parse_lens(&written, &Catalog::default()).unwrap().variables, file.variables);
    for (from, to, said) in [
        ("min = -0.008", "min = 0.001", "on one side of the plane"),
        ("min = -0.008", "min = 0.008", "reversed"),
    ] {
        let error = parse_lens(&format!("{PLATE}{}", variable.replace(from, to)), &catalog()).unwrap_err();
        assert!(error.to_string().contains(said) && error.line.is_some(), "{error}");
    }
}

/// A pickup that gives a number another value than the file is named with its line and both values.
#[test]
fn pickups_that_contradict_the_file_are_named() {
    let text = nominal();
    let with = |scale: &str| {
        let pickup =
            format!("[[pickup]]\nsurface = 1\nparameter = \"thickness_mm\"\nfollows = 2\n{scale}\n\n");
        let at = text.find("[solve]").unwrap();
        let line = 2 + text[..at].matches('\n').count();
        let text = format!("{}{pickup}{}", &text[..at], &text[at..]);
        (parse_lens_start(&text, &catalog()).unwrap(), line)
    };
    let (import, line) = with("scale = 0.5");
    let said: Vec<String> = import.losses.iter().map(ToString::to_string).collect();
    let wanted = "thickness_mm of surface 1 is 4.014 in the file, and its pickup makes it 4.055: optimisations and designs begin with";
    assert!(
        said.len() == 1 && said[0].starts_with(&format!("line {line}: `[[pickup]]`: {wanted}")),
        "{said:?}"
    );
    // Sums are said without the digits of binary fractions.
    let sum = with("scale = 0.1\noffset = 0.7").0.losses[0].to_string();
    assert!(sum.contains("makes it 1.511:"), "{sum}");
    // A number that is rounded as tables round it contradicts nothing.
    assert!(with("offset = -4.0960001").0.losses.is_empty());
}

/// A solve that the lens of the file does not fulfil is named with its line and both values.
#[test]
fn solves_that_contradict_the_file_are_named() {
    let text = nominal();
    let with = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        let changed = text.replace(from, to);
        let line = 1 + changed[..changed.find(to).unwrap()].matches('\n').count();
        (parse_lens_start(&changed, &catalog()).unwrap().losses, line)
    };
    let solve = "efl_mm = 25.04003827951391";
    assert!(with(solve, "efl_mm = 25.0401").0.is_empty());
    let (losses, line) = with(solve, "efl_mm = 26.0");
    let wanted = "the focal length is 25.04004 mm in the file, and its solve makes it 26 mm: optimisations and designs begin with";
    assert!(
        losses.len() == 1 && losses[0].to_string().starts_with(&format!("line {line}: `[solve]`: {wanted}")),
        "{losses:?}"
    );
    assert_eq!(losses[0].effect, Effect::Unsolved);
}

#[test]
fn a_radius_holds_the_magnification_of_a_near_object() {
    let near = nominal().replace("distance_mm = inf", "distance_mm = 120.0");
    let near = near.split("[expect]").next().unwrap().replace(
        "efl = { surface = 7, efl_mm = 25.04003827951391, radius_mm = [-15.05, -11.5] }",
        "magnification = { surface = 7, magnification = -0.25, radius_mm = [-15.05, -11.5] }",
    );
    let file = parse_lens(&near, &catalog()).unwrap();
    let solve = MagnificationSolve { surface: 6, magnification: -0.25, radius_mm: Some([-15.05, -11.5]) };
    assert_eq!((file.efl_solve, file.magnification_solve), (None, Some(solve)));
    assert_eq!(parse_lens(&write_lens(&file), &Catalog::default()).unwrap().magnification_solve, Some(solve));
    let refused = |from: &str, to: &str| {
        assert!(near.contains(from), "{from}");
        let error = parse_lens(&near.replace(from, to), &catalog()).unwrap_err();
        format!("{error} {}", error.hint.clone().unwrap_or_default())
    };
    let said = refused("distance_mm = 120.0", "distance_mm = inf");
    assert!(said.contains("no magnification") && said.contains("efl_mm"), "{said}");
    let both = "[solve]\nefl = { surface = 7, efl_mm = 25.0 }";
    assert!(refused("[solve]", both).contains("not both"));
    assert!(refused("magnification = -0.25", "magnification = 0.0").contains("magnification of 0"));
    assert!(refused("surface = 7, magn", "surface = 6, magn").contains("a variable already"));
}
