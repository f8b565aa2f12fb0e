//! Light that a lens, its aperture or the grid of its PSFs loses, and what is said of it before the first step.

use crate::common::{data_folder, library};
use petzval_base::Cancel;
use petzval_design::block::OpticsBlock;
use petzval_design::experiment::{Experiment, LensGoal, LensSearch, PsfsBy};
use petzval_design::first_look::{FirstLook, first_look};
use petzval_design::fit::{FitOf, fit};
use petzval_design::setup::Setup;
use petzval_learn::Device;
use petzval_optics::constraint::{Constraint, passing_share};

/// A lens whose first surface cuts the beams of the corner gets no smaller spots by cutting more; one whose stop alone decides has no such requirement.
#[test]
fn clear_apertures_that_cut_light_may_not_cut_more_of_it() {
    let assets = library();
    let text = std::fs::read_to_string(data_folder().join("lenses/cooke-triplet-nominal.toml")).unwrap();
    let cut = text.replacen("semi_diameter_mm = 7.733", "semi_diameter_mm = 5.0", 1);
    assert_ne!(cut, text);
    let assets = assets.with_text("cut.toml".to_owned(), cut);
    let setup = |lens: &str| {
        let mut experiment = Experiment::parse("").unwrap();
        experiment.lens = lens.to_owned();
        Setup::new(experiment, &assets, Device::flex().autodiff()).unwrap()
    };
    let is_light = |c: &Constraint| matches!(c, Constraint::Light { .. });
    let whole = setup("cooke-triplet-nominal");
    assert!(!whole.nominal().requirements.constraints().iter().any(is_light));

    let cut = setup("cut.toml");
    let start = cut.nominal();
    let held: Vec<Constraint> = start.requirements.constraints().iter().copied().filter(is_light).collect();
    assert!(!held.is_empty(), "{:?}", start.requirements);
    let mut block = OpticsBlock::new(start.clone(), 1.0);
    let spot = |block: &mut OpticsBlock, iterations| {
        block.improve(LensGoal::Spot, iterations, LensSearch::default(), &mut |_| Ok(()), &Cancel::default())
    };
    let losses = spot(&mut block, 8).unwrap();
    assert!(losses["penalty_mm2"] < 1e-3, "{losses:?}");
    let lens = block.lens().unwrap();
    for constraint in &held {
        let Constraint::Light { field_rad, least, .. } = constraint else { unreachable!() };
        let share = passing_share(&lens, *field_rad).unwrap();
        assert!(share > least - 5e-3, "{field_rad}: {share} {least}");
    }
    // A lens that lost light all the same gets a remark.
    let mut narrow = start.lens_file.lens.clone();
    narrow.surfaces[0].semi_diameter_mm = 4.5;
    let said = start.darker_corner(&start.lens_file.lens, &narrow).unwrap();
    assert!(
        said.starts_with("in the corner of the sensor ") && said.contains("passes the clear apertures"),
        "{said}"
    );
    assert_eq!(start.darker_corner(&narrow, &start.lens_file.lens), None);
}

/// The middle of the bounds of a lens images nothing sharply, and stands in an experiment to show that.
#[test]
fn a_lens_that_the_experiment_derives_may_be_out_of_focus() {
    let assets = library();
    let experiment = assets.experiment("cooke-triplet-image-quality-controls").unwrap();
    let setup = Setup::new(experiment, &assets, Device::flex()).unwrap();
    let look = first_look(&setup).unwrap();
    assert!(look.problems.is_empty(), "{:?}", look.problems);
    let said = |words: &str| look.warnings.iter().any(|warning| warning.contains(words));
    assert!(said("middle of its bounds: the PSFs' grid"), "{:?}", look.warnings);
    setup.cancel.set();
    assert!(first_look(&setup).unwrap_err().is_stopped());
}

/// Little area of a sensor lies beyond the outermost field of the spot goal: a corner that loses is said.
#[test]
fn a_corner_that_a_lens_for_least_spots_gives_up_is_said() {
    let assets = library();
    let experiment = assets.experiment("cooke-triplet-image-quality").unwrap();
    let setup = Setup::new(experiment, &assets, Device::flex()).unwrap();
    let start = setup.start(&setup.variants[0]);
    let sharp = &start.lens_file.lens;
    // Half a millimetre at f/4.4 adds some 40 um to the 20 um of the corner.
    let blurred = sharp.with_image_distance(sharp.image_distance_mm() + 0.5);
    let said = start.worse_corner(sharp, &blurred).unwrap();
    assert!(
        said.starts_with("in the corner of the sensor the RMS spot is ") && said.contains("and was 20."),
        "{said}"
    );
    assert_eq!(start.worse_corner(&blurred, sharp), None);
    assert_eq!(start.worse_corner(sharp, sharp), None);
}

/// A grid of 48 um holds 97 % of the triplet's light on the axis, and a quarter of it in the corner of the sensor.
#[test]
fn light_that_the_grid_cuts_off_is_said_before_the_first_step() {
    let assets = library();
    let looked_at = |grid: usize| {
        let mut experiment = assets.experiment("cooke-triplet-image-quality").unwrap();
        (experiment.psf.grid, experiment.psf.kind) = (grid, PsfsBy::Geometric);
        first_look(&Setup::new(experiment, &assets, Device::flex()).unwrap()).unwrap()
    };
    let says_so = |look: &FirstLook| look.warnings.iter().any(|warning| warning.contains("cuts off"));
    assert!(!says_so(&looked_at(128)));
    let look = looked_at(32);
    assert!(look.problems.is_empty() && says_so(&look), "{:?} {:?}", look.problems, look.warnings);
    // The warning is that of the worst row of the table.
    let fields = &look.lenses[0].fields;
    let worst = fields.iter().min_by(|a, b| a.light_on_grid.total_cmp(&b.light_on_grid)).unwrap();
    let place = format!(
        "cuts off {:.0} % of the light at {:.1} degrees",
        100.0 * (1.0 - worst.light_on_grid),
        worst.field_deg
    );
    assert!(look.warnings.iter().any(|warning| warning.contains(&place)), "{place} {:?}", look.warnings);
}

/// The colours of a lens for other light are its ends and their middle, without the digits of rounding: half of 0.8 + 0.9 is 0.8500000000000001.
#[test]
fn colours_of_a_lens_for_the_near_infrared_are_round() {
    let assets = library();
    let fitted_in = |um: &[f64]| {
        let mut experiment = assets.experiment("cooke-triplet-image-quality").unwrap();
        experiment.psf.kind = PsfsBy::Geometric;
        let pictures = assets.facts_of(&experiment).unwrap().pictures;
        let mut lens = assets.reported("cooke-triplet-nominal").unwrap();
        (lens.file.lens.wavelengths_um, lens.file.lens.reference_um) = (um.to_vec(), um[0]);
        let of = FitOf { experiment, lens, lens_name: "nir", sensor: None, pictures };
        let fitted = fit(of, &assets).unwrap();
        (fitted.experiment.psf.wavelengths_um, fitted.warnings.join("; "))
    };
    let (colours_um, said) = fitted_in(&[0.8, 0.9]);
    assert_eq!(colours_um, [0.9, 0.85, 0.8]);
    assert!(said.contains("made for 0.8 to 0.9 um: psf.wavelengths_um = [0.9, 0.85, 0.8]"), "{said}");
    assert!(fitted_in(&[0.85]).1.contains("made for 0.85 um:"));
}

#[test]
fn a_fit_that_is_cancelled_ends_before_the_next_field() {
    let cancel = Cancel::default();
    let assets = library().stopped_by(cancel.clone());
    let experiment = assets.experiment("cooke-triplet-image-quality").unwrap();
    let pictures = assets.facts_of(&experiment).unwrap().pictures;
    let lens = assets.reported("cooke-triplet-nominal").unwrap();
    let of = FitOf { experiment, lens, lens_name: "triplet", sensor: None, pictures };
    cancel.set();
    assert!(fit(of, &assets).is_err_and(|error| error.is_stopped()));
}

/// The built-in photographs hold no blur of 1 mm: the grid that is written is narrower than the one that was found, and what is said of its light
/// is measured on it.
#[test]
fn lost_light_is_that_of_the_grid_that_is_written() {
    let singlet = "name = \"f/2 singlet\"\nunits = \"mm\"\n[aperture]\nentrance_pupil_diameter_mm = 12.0\n[object]\ndistance_mm = inf\n\
                   [wavelengths]\num = [0.486, 0.5876, 0.656]\nreference_um = 0.5876\n[fields]\nangle_deg = [0.0, 10.0]\n\
                   [[surface]]\nstop = true\nradius_mm = 25.0\nthickness_mm = 5.0\nglass = \"N-BK7\"\nsemi_diameter_mm = 6.5\n\
                   [[surface]]\nradius_mm = -25.0\nthickness_mm = 23.0\nsemi_diameter_mm = 7.0\n";
    let assets = library();
    let assets = assets.with_text("singlet.toml".to_owned(), singlet.to_owned());
    let mut experiment = assets.experiment("cooke-triplet-image-quality").unwrap();
    experiment.psf.kind = PsfsBy::Geometric;
    let pictures = assets.facts_of(&experiment).unwrap().pictures;
    let lens = assets.reported("singlet.toml").unwrap();
    let of = FitOf { experiment, lens, lens_name: "singlet.toml", sensor: None, pictures };
    let fitted = fit(of, &assets).unwrap();
    assert!(fitted.notes.iter().any(|note| note.starts_with("psf.grid = ")), "{:?}", fitted.notes);
    let psf = &fitted.experiment.psf;
    let said = format!("the PSF grid of {:.0} um cuts off", psf.grid as f64 * psf.pitch_um);
    assert!(fitted.warnings.iter().any(|warning| warning.contains(&said)), "{said} {:?}", fitted.warnings);
}
