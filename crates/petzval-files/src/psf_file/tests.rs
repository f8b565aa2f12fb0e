use super::*;
use crate::npy_array::{FloatType, float_bytes};

/// Two fields of unequal values, so that a wrong order of axes or bytes shows.
fn bank() -> PsfFile {
    let (fields, grid) = (2, 4);
    let cells = grid * grid;
    let mut values: Vec<f64> =
        (0..fields * 3 * cells).map(|i| 1.0 + f64::from((i * 37 % 23) as u32)).collect();
    for psf in values.chunks_exact_mut(cells) {
        let sum: f64 = psf.iter().sum();
        psf.iter_mut().for_each(|value| *value /= sum);
    }
    let axes = PsfAxes {
        lens: "a lens".to_owned(),
        kind: Some(PsfOrigin::Geometric),
        wavelengths_um: vec![0.62, 0.55, 0.486],
        chief_ray_x_mm: vec![0.0; 2],
        chief_ray_y_mm: vec![0.0, 2.0],
        field_deg: vec![0.0, 10.0],
        image_scale_mm: Some(11.5),
        captured: vec![vec![1.0, 0.99, 0.98]; 2],
        pupil_cells: Some(64),
        pupil_error: Some(0.01),
        method: vec![
            vec![
                Method::Polynomial { degree: 8, residual_um: 1e-3 },
                Method::Traced,
                Method::Wave { degree: 10 }
            ];
            2
        ],
        ..PsfAxes::new(1.5, vec![0.0, 2.0])
    };
    PsfFile::new(axes, [fields, 3, grid, grid], values, vec![1.0, 1.0, 1.0, 0.8, 0.7, 0.6]).unwrap()
}

fn text_of(bank: &PsfFile) -> String {
    let [_, _, (_, axes)] = psf_files(bank, FloatType::Float64).unwrap();
    String::from_utf8(axes).unwrap()
}

/// The error of a bank whose axes have this text and whose arrays are good, on one line.
fn refused(text: &str) -> String {
    let [(_, values), (_, light), _] = psf_files(&bank(), FloatType::Float64).unwrap();
    match parse_psfs(text, &values, Some(&light)).unwrap_err() {
        WrongPart::Axes(error) => error.to_string(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_is_written_is_read_in_every_precision() {
    let (folder, wanted) = (tempfile::tempdir().unwrap(), bank());
    for (precision, most) in
        [(FloatType::Float64, 0.0), (FloatType::Float32, 1e-7), (FloatType::Float16, 1e-3)]
    {
        let at = folder.path().join(format!("{precision:?}"));
        let files = write_psfs(&bank(), &at, precision).unwrap();
        assert!(files.iter().all(|file| file.is_file()));
        for path in [at.clone(), at.join(AXES_FILE)] {
            let read = read_psfs(&path).unwrap();
            assert_eq!(
                (&read.axes, read.shape, &read.illumination),
                (&wanted.axes, wanted.shape, &wanted.illumination)
            );
            let off = read.values.iter().zip(&wanted.values).map(|(a, b)| ((a - b) / b).abs());
            assert!(off.fold(0.0, f64::max) <= most, "{precision:?}");
        }
        // No part of a file is left.
        assert_eq!(std::fs::read_dir(&at).unwrap().count(), 3);
    }
}

#[test]
fn a_few_lines_by_hand_are_enough_and_illumination_is_1_without_its_file() {
    let values = float_bytes(&[1, 1, 2, 2], &[0.5, 0.25, 0.25, 0.0], FloatType::Float32).unwrap();
    let text = r#"{"pitch_um": 2.0, "field_radius_mm": [0.0], "version": 1}"#;
    let bank = parse_psfs(text, &values, None).unwrap();
    assert_eq!((bank.shape, bank.illumination.as_slice()), ([1, 1, 2, 2], &[1.0][..]));
    // One wavelength stands for three colours.
    let camera = bank.for_cameras().unwrap();
    assert_eq!(camera.values, [0.5, 0.25, 0.25, 0.0].repeat(3));
    assert_eq!((camera.pitch_um, camera.illumination), (2.0, vec![1.0; 3]));
    assert!(bank.distortion().unwrap().is_none());
}

#[test]
fn a_file_of_an_earlier_program_is_read() {
    let mut bank = bank();
    bank.axes = PsfAxes { kind: None, image_scale_mm: None, ..bank.axes };
    let folder = tempfile::tempdir().unwrap();
    let [_, _, path] = write_psfs(&bank, folder.path(), FloatType::Float64).unwrap();
    let known = ["format", "version", "values_file", "illumination_file", "rotationally_symmetric"];
    let text = std::fs::read_to_string(&path).unwrap();
    let earlier: Vec<&str> =
        text.lines().filter(|line| !known.iter().any(|key| line.contains(&format!("\"{key}\"")))).collect();
    std::fs::write(&path, earlier.join("\n")).unwrap();
    assert_eq!(read_psfs(folder.path()).unwrap(), bank);
    // It does not name its illumination, and needs it.
    std::fs::remove_file(folder.path().join(ILLUMINATION_FILE)).unwrap();
    let error = read_psfs(folder.path()).unwrap_err().to_string();
    assert!(error.contains("illumination.npy"), "{error}");
}

#[test]
fn psfs_in_toml_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let axes = "source = \"captures\"\nvalues = \"psfs.npy\"\ngrid = 4\npitch_um = 1.5\nfield_radius_mm = [0.0, 2.0]\n\
                illumination = [[1.0, 1.0, 1.0], [0.8, 0.7, 0.6]]\n";
    let path = at.join(OLD_AXES_FILE);
    let write = |axes: &str| std::fs::write(&path, axes).unwrap();
    write(axes);
    std::fs::write(
        at.join("psfs.npy"),
        float_bytes(&[2, 3, 4, 4], &bank().values, FloatType::Float32).unwrap(),
    )
    .unwrap();
    let read = read_psfs(at).unwrap();
    assert_eq!(
        (read.axes.kind, read.axes.channels.as_slice()),
        (Some(PsfOrigin::Measured), &Channel::RGB[..])
    );
    let (of_old, of_new) = (read.for_cameras().unwrap(), bank().for_cameras().unwrap());
    assert_eq!(of_old, of_new);
    for (from, to, says) in [
        ("grid = 4", "grid = 5", "psfs.npy: holds [2, 3, 4, 4]; [2, 3, 5, 5] are needed"),
        ("grid = 4", "grid = 4294967296", "too many"),
        ("pitch_um = 1.5", "pitch_um = -1.5", "line 4, column 12: `pitch_um = -1.5`"),
        ("[0.0, 2.0]", "[0.5, 2.0]", "radii start at 0"),
        ("[0.8, 0.7", "[-0.8, 0.7", "`illumination = "),
        ("values = ", "value = ", "`value = "),
        ("psfs.npy", "none.npy", "none.npy"),
    ] {
        write(&axes.replace(from, to));
        let error = read_psfs(at).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    // A folder with both holds what was written last in the new form.
    write_psfs(&bank(), at, FloatType::Float64).unwrap();
    assert_eq!(read_psfs(at).unwrap(), bank());
}

#[test]
fn cameras_get_fields_outwards_and_colours_from_red_to_blue() {
    let wanted = bank().for_cameras().unwrap();
    assert_eq!(wanted.values[5], bank().values[5] as f32);
    assert_eq!(wanted.illumination, [1.0, 1.0, 1.0, 0.8, 0.7, 0.6]);
    // The same bank with its fields, and then its wavelengths, the other way round.
    let cells = 16;
    let turned = |order: &dyn Fn(usize) -> usize| -> Vec<f64> {
        (0..6).flat_map(|i| bank().values[order(i) * cells..][..cells].to_vec()).collect()
    };
    let light = |order: &dyn Fn(usize) -> usize| (0..6).map(|i| bank().illumination[order(i)]).collect();
    let fields: &dyn Fn(usize) -> usize = &|i| (i + 3) % 6;
    let inwards = PsfFile {
        axes: PsfAxes { field_radius_mm: vec![2.0, 1e-12], chief_ray_y_mm: Vec::new(), ..bank().axes },
        values: turned(fields),
        illumination: light(fields),
        ..bank()
    };
    assert_eq!(inwards.for_cameras().unwrap(), wanted);
    let colours: &dyn Fn(usize) -> usize = &|i| i / 3 * 3 + 2 - i % 3;
    let blue_first = PsfFile {
        axes: PsfAxes { wavelengths_um: vec![0.486, 0.55, 0.62], ..bank().axes },
        values: turned(colours),
        illumination: light(colours),
        ..bank()
    };
    assert_eq!(blue_first.for_cameras().unwrap(), wanted);
    // Where channels are named, they count, whatever the wavelengths.
    let named =
        PsfFile { axes: PsfAxes { channels: Channel::RGB.to_vec(), ..blue_first.axes.clone() }, ..bank() };
    assert_eq!(named.for_cameras().unwrap(), wanted);
}

#[test]
fn distortion_follows_from_field_angles_and_the_scale_of_the_image() {
    let map = bank().distortion().unwrap().unwrap();
    assert!((map.ideal_mm(2.0) - 11.5 * 10.0_f64.to_radians().tan()).abs() < 1e-12);
    let wide = PsfFile { axes: PsfAxes { field_deg: vec![0.0, 89.0], ..bank().axes }, ..bank() };
    assert!(wide.distortion().unwrap_err().to_string().contains("field_deg 89"));
    let without = PsfFile { axes: PsfAxes { image_scale_mm: None, ..bank().axes }, ..bank() };
    assert!(without.distortion().unwrap().is_none());
}

#[test]
fn what_cameras_cannot_take_is_refused() {
    let says = |axes: PsfAxes| PsfFile { axes, ..bank() }.for_cameras().unwrap_err();
    for (axes, key) in [
        (bank().axes.symmetric(false), "rotationally_symmetric"),
        (PsfAxes { field_radius_mm: vec![0.5, 2.0], ..bank().axes }, "field_radius_mm"),
        (PsfAxes { field_radius_mm: vec![0.0, 0.0], ..bank().axes }, "field_radius_mm"),
        (PsfAxes { chief_ray_y_mm: vec![0.0, -2.0], ..bank().axes }, "chief_ray_y_mm"),
        (PsfAxes { channels: vec![Channel::Red; 3], ..bank().axes }, "channels"),
    ] {
        let fault = says(axes);
        assert!(fault.key == key && !fault.hint.is_empty(), "{fault}");
    }
    let two = PsfFile::new(PsfAxes::new(1.0, vec![0.0]), [1, 2, 2, 2], vec![0.25; 8], vec![1.0; 2]);
    assert!(two.unwrap().for_cameras().unwrap_err().message.contains("three colours"));
}

#[test]
fn every_defect_of_the_axes_is_named_with_key_line_and_hint() {
    let good = text_of(&bank());
    for (from, to, says) in [
        ("\"version\": 1", "\"version\": 2", "`version`: version 2 is younger"),
        ("petzval-psfs", "zemax", "another format"),
        ("\"row\",\n    \"column\"", "\"column\",\n    \"row\"", "axes field, wavelength, column, row"),
        ("y, away from the axis", "y, downwards", "`row_axis`"),
        ("\"psf.npy\"", "\"../psf.npy\"", "`values_file`"),
        ("\"pitch_um\": 1.5", "\"pitch_um\": 0.0", "`pitch_um = 0`: not between"),
        ("\"pitch_um\": 1.5", "\"pitch_um\": -1.0", "`pitch_um = -1`"),
        ("\"pitch_um\": 1.5", "\"pitch_um\": \"1.5\"", "`pitch_um`: expected a number, found a text"),
        ("\"pitch_um\": 1.5,", "", "the key `pitch_um` is missing"),
        ("\"pitch_um\"", "\"pitch_mm\"", "`pitch_mm`: no such key here"),
        (
            "\"field_radius_mm\": [\n    0.0,\n    2.0",
            "\"field_radius_mm\": [\n    0.0,\n    -2.0",
            "`field_radius_mm = -2`",
        ),
        (
            "\"field_radius_mm\": [\n    0.0,",
            "\"field_radius_mm\": [",
            "1 numbers, and the array has 2 fields",
        ),
        ("10.0\n", "180.0\n", "`field_deg = 180`"),
        ("11.5", "-11.5", "`image_scale_mm = -11.5`"),
        ("0.62,", "620.0,", "`wavelengths_um = 620`"),
        ("    0.62,\n", "", "2 entries, and the array has 3 wavelengths"),
        ("      0.98\n", "      0.98, 1.0\n", "`captured`"),
        ("\"rotationally_symmetric\": true", "\"rotationally_symmetric\": 5", "`rotationally_symmetric`"),
        ("\"geometric\"", "\"rays\"", "`kind`"),
    ] {
        assert!(good.contains(from), "{from}: {good}");
        let error = refused(&good.replacen(from, to, 1));
        assert!(error.contains(says), "{error}");
    }
    // What is cut off has a place.
    assert!(refused(&good[..good.len() / 2]).contains("line "));
    assert!(refused("").contains("EOF"));
    let aside = PsfFile { axes: PsfAxes { chief_ray_x_mm: vec![0.0, 0.5], ..bank().axes }, ..bank() };
    assert!(aside.check().unwrap_err().hint.contains("false for rotationally_symmetric"));
    let without_places =
        PsfFile { axes: PsfAxes { chief_ray_x_mm: Vec::new(), ..bank().axes.symmetric(false) }, ..bank() };
    assert!(without_places.check().unwrap_err().hint.contains("chief_ray_x_mm"));
}

#[test]
fn every_defect_of_the_arrays_is_named() {
    let with = |change: &dyn Fn(&mut PsfFile)| {
        let mut bank = bank();
        change(&mut bank);
        bank.check().unwrap_err().to_string()
    };
    for (error, says) in [
        (with(&|b| b.values[17] = f64::NAN), "field 0, wavelength 1 holds NaN at row 0, column 1"),
        (with(&|b| b.values[64] = -1e-9), "values -0.000000001"),
        (with(&|b| b.values[80..96].fill(0.0)), "the PSF of field 1, wavelength 2 sums to 0"),
        (with(&|b| b.values[3] += 0.01), "field 0, wavelength 0 sums to 1.01"),
        (with(&|b| b.illumination[4] = f64::INFINITY), "inf of field 1, wavelength 1"),
        (with(&|b| b.illumination.truncate(5)), "5 numbers for 2 fields of 3 wavelengths"),
        (with(&|b| b.values.truncate(5)), "5 numbers of shape [2, 3, 4, 4]"),
        (with(&|b| b.shape = [2, 3, 2, 8]), "not as many rows as columns"),
        (with(&|b| b.shape = [usize::MAX, 3, 4, 4]), "numbers of shape"),
    ] {
        assert!(error.contains(says) && error.contains("hint: "), "{error}");
    }
    // Files whose shapes disagree, or that are no arrays.
    let [(_, values), (_, light), (_, text)] = psf_files(&bank(), FloatType::Float64).unwrap();
    let text = String::from_utf8(text).unwrap();
    let square = float_bytes(&[6, 4, 4], &bank().values, FloatType::Float64).unwrap();
    let short = float_bytes(&[3, 2], &bank().illumination, FloatType::Float64).unwrap();
    let values_error = |values: &[u8]| match parse_psfs(&text, values, Some(&light)).unwrap_err() {
        WrongPart::Values(error) => error.to_string(),
        other => panic!("{other:?}"),
    };
    assert!(values_error(&square).contains("an array of 3 axes, shape [6, 4, 4] (hint: numpy.save"));
    assert!(values_error(&values[..values.len() - 8]).contains("bytes of data"));
    assert!(values_error(b"zip").contains("the file ends in its header"));
    match parse_psfs(&text, &values, Some(&short)).unwrap_err() {
        WrongPart::Illumination(error) => assert!(error.to_string().contains("shape [3, 2]"), "{error}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_bank_with_a_fault_or_without_a_place_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut wrong = bank();
    wrong.values[0] = f64::NAN;
    assert!(write_psfs(&wrong, &folder.path().join("new"), FloatType::Float64).is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    std::fs::create_dir(folder.path().join(VALUES_FILE)).unwrap();
    assert!(matches!(write_psfs(&bank(), folder.path(), FloatType::Float64), Err(PsfFileError::Io { .. })));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    let missing = read_psfs(&folder.path().join("none")).unwrap_err();
    assert!(matches!(missing, PsfFileError::Io { .. }) && missing.to_string().contains("none"));
}

#[test]
fn damaged_files_are_read_or_refused_and_nothing_else() {
    let [(_, values), (_, light), (_, text)] = psf_files(&bank(), FloatType::Float32).unwrap();
    let mut state = 1_u64;
    let mut random = |below: usize| {
        // A linear congruential generator (Knuth's MMIX constants).
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for _ in 0..3000 {
        let mut files = [text.clone(), values.clone(), light.clone()];
        let file = &mut files[random(3)];
        for _ in 0..1 + random(4) {
            let at = random(file.len());
            file[at] = random(256) as u8;
        }
        file.truncate(file.len() - random(8) * random(2));
        let [text, values, light] = &files;
        if let Ok(bank) = parse_psfs(&String::from_utf8_lossy(text), values, Some(light)) {
            assert_eq!(bank.check(), Ok(()));
            let _taken_or_refused = (bank.for_cameras(), bank.distortion());
        }
    }
}

#[test]
fn psfs_of_any_sum_can_be_normalised() {
    let scaled = bank().values.iter().map(|value| 7.0 * value).collect();
    let made = PsfFile::normalised(bank().axes, bank().shape, scaled, bank().illumination).unwrap();
    assert!(made.values.iter().zip(&bank().values).all(|(a, b)| (a - b).abs() < 1e-15));
    let dark =
        PsfFile::normalised(bank().axes, bank().shape, vec![0.0; 96], bank().illumination).unwrap_err();
    assert!(dark.to_string().contains("sums to 0"));
}
