//! What is written is read again, to the last bit.

use std::sync::Arc;

use petzval_base::FileError;
use petzval_files::{Import, LensFile, parse_lens, parse_seq, parse_zmx, write_lens, write_seq, write_zmx};
use petzval_optics::glass::{Catalog, Dispersion, Glass};
use petzval_optics::lens::{Lens, ObjectDistance, Surface};
use petzval_optics::paraxial::first_order;
use petzval_optics::trace::{launch, trace_ray};

use crate::built_in::all_lenses;
use crate::common::{mangin, nominal_triplet, special_lenses, telescope};
use crate::support::catalog;

pub fn file(lens: Lens) -> LensFile {
    LensFile::of(lens)
}

/// Compares the numbers of two lenses to the bit. Names of glasses and notes may differ.
pub fn same_numbers(a: &Lens, b: &Lens) {
    assert_eq!(a.surfaces.len(), b.surfaces.len());
    for (i, (x, y)) in a.surfaces.iter().zip(&b.surfaces).enumerate() {
        let bare = |s: &Surface| Surface { glass: Glass::air(), label: String::new(), ..s.clone() };
        assert_eq!(bare(x), bare(y), "surface {}", i + 1);
        let bits = |s: &Surface| {
            [s.shape.curvature, s.shape.conic, s.thickness_mm, s.semi_diameter_mm].map(f64::to_bits)
        };
        assert_eq!(bits(x), bits(y), "surface {}", i + 1);
        assert_eq!(x.glass.dispersion, y.glass.dispersion, "surface {}", i + 1);
        assert_eq!(x.label, y.label);
    }
    let rest = |l: &Lens| Lens { surfaces: vec![], source: String::new(), ..l.clone() };
    assert_eq!(rest(a), rest(b));
}

#[test]
fn writing_and_reading_every_built_in_lens_keeps_its_bits() {
    let catalog = catalog();
    let lenses = all_lenses();
    assert!(lenses.len() >= 8);
    for file in lenses {
        let zmx = parse_zmx(&write_zmx(&file, &catalog).unwrap().text, &catalog).unwrap();
        same_numbers(&file.lens, &zmx.file.lens);
        let seq = parse_seq(&write_seq(&file, &catalog).unwrap().text, &catalog).unwrap();
        same_numbers(&file.lens, &seq.file.lens);
    }
}

/// A field that is the mirror image of another adds its weight, as both are in the merit of the program.
#[test]
fn weights_of_fields_are_written_and_read_in_every_format() {
    let catalog = catalog();
    let plain = file(nominal_triplet());
    assert!(!write_lens(&plain).contains("weight"));
    assert!(write_zmx(&plain, &catalog).unwrap().text.contains("FWGN 1 1 1 1\n"));
    let weights = vec![1.0, 0.25, 0.0, 1.0 / 3.0];
    let weighted = LensFile { field_weights: weights.clone(), ..plain };
    let toml = parse_lens(&write_lens(&weighted), &catalog).unwrap();
    assert_eq!(toml, weighted);
    let zmx = write_zmx(&weighted, &catalog).unwrap();
    let seq = write_seq(&weighted, &catalog).unwrap();
    for (read, export) in [(parse_zmx(&zmx.text, &catalog), &zmx), (parse_seq(&seq.text, &catalog), &seq)] {
        let read = read.unwrap();
        assert_eq!(read.file.field_weights, weights, "{}", export.text);
        let lost = [&read.losses, &export.losses].into_iter().flatten();
        assert!(!lost.into_iter().any(|loss| loss.message.contains("weight")), "{}", export.text);
    }
    let start = zmx.text.find("YFLN").unwrap();
    let end = start + zmx.text[start..].find("WAVM").unwrap();
    let mirrored = zmx.text[..start].replace("FTYP 0 0 4", "FTYP 0 0 5")
        + "YFLN 0 -14 7 14 20\nFWGN 1 3 2 4 1\n"
        + &zmx.text[end..];
    let file = parse_zmx(&mirrored.replace("XFLN 0 0 0 0", "XFLN 0 0 0 0 0"), &catalog).unwrap().file;
    assert_eq!(file.lens.fields_deg, [0.0, 7.0, 14.0, 20.0]);
    assert_eq!(file.field_weights, [1.0, 2.0, 7.0, 1.0]);
}

#[test]
fn weights_that_make_no_sense_are_refused_by_their_line() {
    let catalog = catalog();
    let plain = file(nominal_triplet());
    let text = write_lens(&LensFile { field_weights: vec![1.0, 2.0, 3.0, 4.0], ..plain.clone() });
    let line = text.lines().position(|line| line.starts_with("weight = ")).unwrap() + 1;
    for (list, message) in [
        ("[1.0, 2.0, 3.0]", "3 weights do not fit the 4 fields"),
        ("[1.0, -2.0, 3.0, 4.0]", "a weight lies between 0 and 1000000"),
        ("[1.0, inf, 3.0, 4.0]", "this must be a finite number"),
        ("[0.0, 0.0, 0.0, 0.0]", "all weights are 0"),
    ] {
        let error = parse_lens(&text.replace("[1.0, 2.0, 3.0, 4.0]", list), &catalog).unwrap_err();
        assert_eq!((error.line, error.key.as_str()), (u32::try_from(line).ok(), "weight"), "{error}");
        assert!(error.message.contains(message), "{list}: {error}");
    }
    // Those that are all the same are none.
    let even = parse_lens(&text.replace("[1.0, 2.0, 3.0, 4.0]", "[2, 2, 2, 2]"), &catalog).unwrap();
    assert_eq!(even, plain);
}

/// Here the entrance pupil counts where the clear aperture of the stop is narrower, and other programs clip at it.
#[test]
fn a_stop_narrower_than_its_beam_is_written_as_wide_as_the_beam() {
    let catalog = catalog();
    let mut lens = nominal_triplet();
    let beam_mm = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm.abs();
    lens.surfaces[lens.stop].semi_diameter_mm = 0.8 * beam_mm;
    let file = file(lens);
    type Read = fn(&str, &Catalog) -> Result<Import, FileError>;
    let readers: [Read; 2] = [parse_zmx, parse_seq];
    for (export, read) in [write_zmx(&file, &catalog), write_seq(&file, &catalog)].into_iter().zip(readers) {
        let export = export.unwrap();
        let said: Vec<&str> = export.losses.iter().map(|loss| loss.message.as_str()).collect();
        assert!(said.iter().any(|said| said.contains("written as wide as the beam")), "{said:?}");
        let again = read(&export.text, &catalog).unwrap().file.lens;
        assert_eq!(again.entrance_pupil_mm, file.lens.entrance_pupil_mm, "{}", export.text);
        assert_eq!(again.surfaces[again.stop].semi_diameter_mm, beam_mm, "{}", export.text);
    }
}

#[test]
fn every_special_surface_is_kept_to_the_bit_or_refused() {
    let catalog = catalog();
    let (mut zmx_refused, mut seq_refused) = (Vec::new(), Vec::new());
    // Neither format supports a polynomial in x and y together with an even asphere.
    let plain = |mut lens: Lens| {
        lens.name += ", no even terms";
        for s in &mut lens.surfaces {
            s.shape.asphere = [0.0; 8];
        }
        lens
    };
    let special = special_lenses();
    let polynomials =
        special.iter().filter(|l| l.name.starts_with("xy")).cloned().map(plain).collect::<Vec<_>>();
    assert_eq!(polynomials.len(), 2);
    for lens in special.into_iter().chain(polynomials).chain([telescope(), mangin(), nominal_triplet()]) {
        let file = file(lens);
        match write_zmx(&file, &catalog) {
            Ok(export) => same_numbers(&file.lens, &parse_zmx(&export.text, &catalog).unwrap().file.lens),
            Err(error) => zmx_refused.push((file.lens.name.clone(), error.to_string())),
        }
        match write_seq(&file, &catalog) {
            Ok(export) => {
                let read =
                    parse_seq(&export.text, &catalog).unwrap_or_else(|e| panic!("{e}\n{}", export.text));
                // The dummy that rotates the axis behind a mirror is an additional surface here.
                if file.lens.name != "folded" {
                    same_numbers(&file.lens, &read.file.lens);
                }
                same_rays(&file.lens, &read.file.lens);
            }
            Err(error) => seq_refused.push((file.lens.name.clone(), error.to_string())),
        }
    }
    let names = |list: &[(String, String)]| list.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&zmx_refused), ["xy", "xy without symmetry", "Q_bfs", "Q_con"]);
    assert_eq!(
        names(&seq_refused),
        ["xy", "xy without symmetry", "Q_bfs", "Q_con", "thin lens", "grating", "binary"]
    );
    for (_, error) in zmx_refused.iter().chain(&seq_refused) {
        assert!(error.starts_with("`surface "), "{error}");
    }
}

fn same_rays(a: &Lens, b: &Lens) {
    for (field, at) in [(0.0, [0.3, 0.2]), (0.05, [-0.4, 0.7]), (0.05, [1.1, -0.9])] {
        let land = |lens: &Lens| {
            let sequence = lens.at_wavelength(lens.reference_um);
            trace_ray(&sequence, launch(&sequence, field, at).ray).image.map(|ray| ray.position)
        };
        let (Some(x), Some(y)) = (land(a), land(b)) else { panic!("{} loses a ray", a.name) };
        for axis in 0..2 {
            assert!((x[axis] - y[axis]).abs() < 1e-11, "{}: {x:?} {y:?}", a.name);
        }
    }
}

#[test]
fn writing_and_reading_keeps_glasses_and_near_objects() {
    let catalog = catalog();
    let mut lens = nominal_triplet();
    lens.object = ObjectDistance::Finite(500.0);
    let glass = |name: &str, dispersion| Arc::new(Glass::new(name, dispersion));
    lens.surfaces[0].glass = glass("MODEL", Dispersion::NdVd { nd: 1.5312345, vd: 55.5 });
    lens.surfaces[5].glass = glass("FLAT", Dispersion::Constant(1.49));
    for (export, parse) in [
        (write_zmx(&file(lens.clone()), &catalog).unwrap(), parse_zmx as fn(&str, &Catalog) -> _),
        (write_seq(&file(lens.clone()), &catalog).unwrap(), parse_seq),
    ] {
        let read: Result<Import, FileError> = parse(&export.text, &catalog);
        let read = read.unwrap().file.lens;
        for (a, b) in lens.fields_deg.iter().zip(&read.fields_deg) {
            assert!((a - b).abs() <= 1e-14 * a, "{a} {b}");
        }
        same_numbers(&Lens { fields_deg: vec![], ..lens.clone() }, &Lens { fields_deg: vec![], ..read });
    }
    // A glass outside the catalogue: .seq supports Schott's formula and tables, neither format supports Sellmeier's.
    let schott = Dispersion::Schott([2.2, -0.01, 0.01, 1e-4, 1e-5, 1e-6]);
    lens.surfaces[0].glass = glass("OWN", schott.clone());
    let error = write_zmx(&file(lens.clone()), &catalog).unwrap_err().to_string();
    assert!(error.contains("`surface 1`: the glass OWN is not in the catalogue"), "{error}");
    assert!(error.contains("put `[glass.OWN]`") && error.contains("--glasses"), "{error}");
    let mut with_own = catalog.clone();
    let own = "[glass.OWN]\nschott = [2.2, -0.01, 0.01, 1e-4, 1e-5, 1e-6]\n";
    with_own.merge(petzval_files::parse_catalog(own).unwrap());
    let export = write_zmx(&file(lens.clone()), &with_own).unwrap();
    assert_eq!(parse_zmx(&export.text, &with_own).unwrap().file.lens.surfaces[0].glass.dispersion, schott);
    let export = write_seq(&file(lens.clone()), &catalog).unwrap();
    assert_eq!(parse_seq(&export.text, &catalog).unwrap().file.lens.surfaces[0].glass.dispersion, schott);
    // A table of two wavelengths stays one; more of them come back as a formula that gives the same indices.
    let table = Dispersion::Table { wavelength_um: vec![0.4, 0.7], index: vec![1.55, 1.51] };
    lens.surfaces[0].glass = glass("OWN", table.clone());
    let export = write_seq(&file(lens.clone()), &catalog).unwrap();
    assert_eq!(parse_seq(&export.text, &catalog).unwrap().file.lens.surfaces[0].glass.dispersion, table);
    let (wavelength_um, index) = (vec![0.4, 0.55, 0.7], vec![1.55, 1.52, 1.51]);
    let table = Dispersion::Table { wavelength_um: wavelength_um.clone(), index: index.clone() };
    lens.surfaces[0].glass = glass("OWN", table);
    let export = write_seq(&file(lens.clone()), &catalog).unwrap();
    let read = parse_seq(&export.text, &catalog).unwrap().file.lens.surfaces[0].glass.clone();
    assert_eq!(read.range_um, Some([0.4, 0.7]));
    for (um, n) in wavelength_um.iter().zip(&index) {
        assert!((read.index(*um) - n).abs() < 1e-12, "{um}: {}", read.index(*um));
    }
    // The formula holds in that range alone, for which the format has no record.
    lens.surfaces[0].glass = read;
    let export = write_seq(&file(lens.clone()), &catalog).unwrap();
    let range = "the glass OWN loses the wavelengths from which its index is known, 0.4 to 0.7 um";
    assert!(export.losses.iter().any(|loss| loss.message == range), "{:?}", export.losses);
    lens.surfaces[0].glass =
        glass("OWN", Dispersion::Sellmeier { b: vec![1.0, 0.2, 1.0], c_um2: vec![0.006, 0.02, 100.0] });
    assert!(write_seq(&file(lens), &catalog).is_err());
}

#[test]
fn parts_that_the_formats_do_not_support_are_reported() {
    let catalog = catalog();
    let file = all_lenses().into_iter().find(|f| f.expect.is_some() && !f.variables.is_empty()).unwrap();
    for export in [write_zmx(&file, &catalog).unwrap(), write_seq(&file, &catalog).unwrap()] {
        let lost: Vec<&str> = export.losses.iter().map(|l| l.record.as_str()).collect();
        for part in ["[[variable]]", "[expect]"] {
            assert!(lost.contains(&part), "{lost:?}");
        }
    }
}
