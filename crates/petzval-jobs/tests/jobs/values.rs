//! Results are values first: what a job keeps as files is what its function gives, which writes nothing.

use std::path::Path;
use std::sync::Arc;

use petzval_camera::image::LinearImage;
use petzval_camera::psf::PsfBank;
use petzval_files::raw_file::load_raw;
use petzval_files::{load_image, save_png16};
use petzval_jobs::isp::{self, develop};
use petzval_jobs::lens::analyze;
use petzval_jobs::raw::mtf;
use petzval_jobs::sensor::capture;
use petzval_jobs::{Context, JobError, Silent, built_in_assets, psf, psf_calibrate, psf_capture, simulate};

use crate::small_sensor;

fn context() -> Context {
    Context::new(built_in_assets(), Arc::new(Silent))
}

/// The numbers of a file of NumPy.
fn npy<T: npyz::Deserialize>(path: &Path) -> Vec<T> {
    npyz::NpyFile::new(&std::fs::read(path).unwrap()[..]).unwrap().into_vec().unwrap()
}

#[test]
fn a_bank_of_psfs_is_what_the_files_hold() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("psf");
    let request = psf::Request {
        lens: "cooke-triplet-nominal".into(),
        out: out.clone(),
        fields: 2,
        grid: 32,
        pitch_um: 4.0,
        ..psf::Request::default()
    };
    let bank = psf::bank(&request, &context()).unwrap();
    assert!(!out.exists());
    assert_eq!(bank.shape(), [2, 3, 32, 32]);
    let response = psf::run(&request, &context()).unwrap();
    assert_eq!(response.axes, bank.axes);
    assert_eq!(npy::<f64>(&out.join("psf.npy")), bank.values());
    assert_eq!(npy::<f64>(&out.join("illumination.npy")), bank.illumination());
}

#[test]
fn a_cancelled_bank_of_psfs_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("psf");
    let of = |kind: psf::PsfKind| psf::Request {
        lens: "cooke-triplet-nominal".into(),
        out: out.clone(),
        fields: 2,
        grid: 32,
        pitch_um: 4.0,
        kind,
        ..psf::Request::default()
    };
    for kind in [psf::PsfKind::Geometric, psf::PsfKind::Diffraction] {
        let context = context();
        context.cancel().set();
        let stopped = psf::run(&of(kind), &context).unwrap_err();
        assert!(matches!(&stopped, JobError::Stopped(stopped) if stopped.kept.is_empty()), "{stopped}");
        assert!(!out.exists());
    }
}

#[test]
fn frames_and_developed_pictures_are_what_the_files_hold() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("taken");
    let request = simulate::Request {
        images: vec!["scene:slanted-edge".into()],
        sensor: small_sensor(folder.path(), 120, 160).into(),
        size: Some((32, 32)),
        spectral: simulate::Spectral { qe: Some("imx219".to_owned()), ..simulate::Spectral::default() },
        isp: Some("quality".to_owned()),
        restore: Some(simulate::Restore::default()),
        raw_format: simulate::RawAs::Npy,
        picture_format: simulate::PictureAs::Npy,
        out: out.clone(),
        ..simulate::Request::default()
    };
    let frames = simulate::frames(&request, &context()).unwrap();
    assert!(!out.exists());
    simulate::run(&request, &context()).unwrap();
    let frame = &frames[0];
    assert_eq!((frames.len(), frame.name.as_str()), (1, "slanted-edge"));
    let raw: Vec<f32> = npy::<u16>(&out.join("slanted-edge-raw.npy")).into_iter().map(f32::from).collect();
    assert_eq!(raw, frame.taken.raw.dn);
    let developed = npy::<f32>(&out.join("slanted-edge-developed.npy"));
    assert_eq!(developed, frame.taken.developed.data);
    assert_ne!(frame.taken.unrestored.as_ref().unwrap().data, developed);
    assert_eq!(frame.by_isp.as_ref().unwrap().data.len(), developed.len());

    // A frame in memory is written as the job writes it.
    let again = folder.path().join("again");
    let formats = (request.raw_format, request.picture_format);
    frame.write(formats, &again, &context()).unwrap();
    let names = |folder: &Path| -> Vec<_> {
        let mut names: Vec<_> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        names
    };
    assert_eq!(names(&again), names(&out));
    for name in names(&out) {
        assert!(
            std::fs::read(again.join(&name)).unwrap() == std::fs::read(out.join(&name)).unwrap(),
            "{name:?}"
        );
    }
    assert!(frame.write(formats, &again, &context()).is_err(), "nothing is overwritten");

    let pictures = folder.path().join("pictures");
    let request = develop::Request {
        raws: vec![out.join("slanted-edge-raw.npy")],
        out: pictures.clone(),
        ..develop::Request::default()
    };
    let values = develop::pictures(&request, &context()).unwrap();
    assert!(!pictures.exists());
    let response = develop::run(&request, &context()).unwrap();
    let written = image::open(&response.pictures[0].picture).unwrap().to_rgb8();
    let picture = &values[0].picture;
    assert_eq!((written.width() as usize, written.height() as usize), (picture.width, picture.height));
    let plane = picture.width * picture.height;
    for (x, y, pixel) in written.enumerate_pixels() {
        let at = y as usize * picture.width + x as usize;
        for (colour, code) in pixel.0.into_iter().enumerate() {
            assert_eq!(u16::from(code), picture.data[colour * plane + at], "{x}, {y}");
        }
    }
}

#[test]
fn photographs_psfs_and_raw_frames_in_memory_give_what_their_files_give() {
    let folder = tempfile::tempdir().unwrap();
    let captures = folder.path().join("pinhole");
    let capture = psf_capture::Request {
        lens: "cooke-triplet-nominal".into(),
        out: captures.clone(),
        fields: 1,
        frames: 2,
        exposures_ms: vec![4.0, 16.0],
        window: 48,
        ..psf_capture::Request::default()
    };
    psf_capture::run(&capture, &context()).unwrap();
    let calibrate =
        psf_calibrate::Request { captures: captures.clone(), ..psf_calibrate::Request::default() };
    let measured = psf_calibrate::measurement(&calibrate, &context()).unwrap();
    let results = captures.join("psf-calibration");
    assert!(!results.exists());
    let response = psf_calibrate::run(&calibrate, &context()).unwrap();
    assert_eq!(response.figures, measured.figures);
    assert_eq!(npy::<f64>(&results.join("measured.npy")), measured.values());
    assert_eq!(npy::<f32>(&results.join("psf.npy")), measured.bank.values);

    // A photograph through the measured PSFs: both from files, and both from memory.
    let photo = folder.path().join("photo.png");
    let mut light = LinearImage::filled(3, 40, 60, 0.2);
    (5..20).for_each(|row| (10..30).for_each(|col| light.set(row % 3, row, col, 0.7)));
    save_png16(&light, &photo).unwrap();
    let light = load_image(&photo).unwrap().light;
    let out = folder.path().join("taken");
    let of_files = simulate::Request {
        images: vec![photo],
        psfs: Some(results),
        size: Some((48, 64)),
        out: out.clone(),
        ..simulate::Request::default()
    };
    let of_memory = simulate::Request { images: vec!["photo".into()], psfs: None, ..of_files.clone() };
    let photos: &[(&str, &LinearImage)] = &[("photo", &light)];
    let memory = simulate::InMemory { photos, psfs: Some(&measured.bank) };
    let frames = simulate::frames_of(&of_memory, memory, &context()).unwrap();
    let frame = &frames[0];
    simulate::run(&of_files, &context()).unwrap();
    let raw = out.join("photo-raw.tiff");
    assert_eq!(load_raw(&raw).unwrap().dn, frame.raw().dn);

    // The raw frame developed: from its file with sidecar and calibration, and from memory.
    let request = develop::Request { raws: vec![raw], ..develop::Request::default() };
    let of_file = develop::pictures(&request, &context()).unwrap();
    let wide = frame.raw().widened();
    let in_memory =
        develop::RawInMemory { name: "photo", frame: &wide, calibration: frame.calibration.as_ref() };
    let nothing = develop::Request::default();
    let of_memory = develop::pictures_of(&nothing, &[in_memory], &context()).unwrap();
    assert_eq!((of_memory.len(), of_memory[0].raw.as_path()), (1, Path::new("photo")));
    assert_eq!(of_memory[0].picture, of_file[0].picture);
    let options = isp::FrameOptions::default();
    let known = isp::frame_in_memory(in_memory, &options, &context()).unwrap();
    assert_eq!(known, isp::read_frame(&request.raws[0], &options, &context()).unwrap());
    let like = isp::frames_like(in_memory, &options, &context()).unwrap();
    assert_eq!((like.height, like.bits, like.cfa, like.about), (0, known.bits, known.cfa, known.about));
    assert!(develop::pictures_of(&nothing, &[], &context()).is_err());
}

#[test]
fn what_in_memory_is_no_picture_and_no_psf_is_refused() {
    let light = LinearImage::filled(3, 40, 60, 0.2);
    let gray = LinearImage::filled(1, 40, 60, 0.2);
    let psf = psf::Request {
        lens: "cooke-triplet-nominal".into(),
        fields: 2,
        grid: 32,
        pitch_um: 4.0,
        ..psf::Request::default()
    };
    let bank = psf::bank(&psf, &context()).unwrap().for_renderer();
    let short = PsfBank { values: bank.values[1..].to_vec(), ..bank.clone() };
    let request = simulate::Request {
        images: vec!["photo".into()],
        size: Some((32, 32)),
        ..simulate::Request::default()
    };
    let refused = |photos: &[(&str, &LinearImage)], psfs: Option<&PsfBank>| {
        let memory = simulate::InMemory { photos, psfs };
        simulate::frames_of(&request, memory, &context()).map(|frames| frames.len())
    };
    assert_eq!(refused(&[("photo", &light)], Some(&bank)).unwrap(), 1);
    for (photos, psfs, says) in [
        (&[("photo", &gray)][..], None, "photo: a picture of 1 planes"),
        (&[("photo", &light), ("other", &light)], None, "other: a photograph that `images` does not list"),
        (&[("photo", &light)], Some(&short), "PSF values"),
    ] {
        let error = refused(photos, psfs).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
    }
}

#[test]
fn frames_of_a_series_come_one_at_a_time_and_end_with_the_job() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("series");
    let request = capture::Request {
        sensor: "imx249-fitted".into(),
        out: out.clone(),
        gains: vec![1.0, 2.0],
        exposures: Some(vec![5.0]),
        dark_exposures: Some(vec![20.0]),
        size: Some([6, 8]),
        ..capture::Request::default()
    };
    let frames = capture::frames(&request, &context()).unwrap();
    assert!(!out.exists());
    assert_eq!(frames.len(), 12);
    let written = capture::run(&request, &context()).unwrap();
    assert_eq!(written.frames, 12);
    for frame in frames {
        let frame = frame.unwrap();
        assert_eq!(load_raw(&out.join(&frame.name)).unwrap().dn, frame.frame.dn, "{}", frame.name);
    }

    let context = context();
    let mut frames = capture::frames(&request, &context).unwrap();
    assert!(frames.next().unwrap().is_ok());
    context.cancel().set();
    assert!(matches!(frames.next(), Some(Err(JobError::Stopped(_)))));
    assert!(frames.next().is_none());
}

#[test]
fn an_analysis_of_a_lens_is_what_the_job_returns() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("analysis");
    let request = analyze::Request {
        lens: "cooke-triplet-nominal".into(),
        out: Some(out.clone()),
        only: vec!["json".to_owned()],
        ..analyze::Request::default()
    };
    let analysis = analyze::analysis(&request, &context()).unwrap();
    assert!(!out.exists());
    let response = analyze::run(&request, &context()).unwrap();
    let text = |analysis: &analyze::Analysis| serde_json::to_string(analysis).unwrap();
    assert_eq!(text(&response.analysis), text(&analysis));
    assert_eq!(std::fs::read_to_string(out.join("analysis.json")).unwrap(), text(&analysis));
}

#[test]
fn edges_in_memory_are_measured_as_those_of_files() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("taken");
    let request = simulate::Request {
        images: vec!["scene:slanted-edge".into()],
        sensor: small_sensor(folder.path(), 160, 200).into(),
        size: Some((128, 128)),
        spectral: simulate::Spectral { qe: Some("flat:0.6".to_owned()), ..simulate::Spectral::default() },
        picture_format: simulate::PictureAs::Exr,
        out: out.clone(),
        ..simulate::Request::default()
    };
    simulate::run(&request, &context()).unwrap();
    let region = mtf::Region { row: 16, col: 16, height: 96, width: 96 };
    let [raw, picture] = ["slanted-edge-raw.tiff", "slanted-edge-developed.exr"].map(|name| out.join(name));
    let of_file = |file: &Path| {
        let request =
            mtf::Request { file: file.to_owned(), regions: vec![region], ..mtf::Request::default() };
        mtf::run(&request, &context()).unwrap()
    };
    let request = mtf::Request { regions: vec![region], ..mtf::Request::default() };
    let in_memory = |pixels: mtf::Pixels<'_>| mtf::edges(&request, "edge", pixels, &context()).unwrap();
    let (frame, light) = (load_raw(&raw).unwrap(), load_image(&picture).unwrap().light);
    let of_raw = in_memory(mtf::Pixels::Raw(&frame));
    assert_eq!((of_raw.file.as_str(), of_raw.edges), ("edge", of_file(&raw).edges));
    assert_eq!(in_memory(mtf::Pixels::Picture(&light)).edges, of_file(&picture).edges);
}

#[test]
fn a_preset_is_written_with_its_values_by_gain() {
    let (assets, cancel) = (built_in_assets(), petzval_base::Cancel::default());
    for name in ["neutral", "quality", "low-light"] {
        let preset = isp::isp_by_name(name, &assets, &cancel).unwrap().preset().unwrap().clone();
        let text = isp::preset_file(&preset).unwrap();
        let read =
            isp::isp_by_name("mine", &assets.clone().with_text("mine".to_owned(), text), &cancel).unwrap();
        assert_eq!(read.preset(), Some(&preset), "{name}");
    }
}
