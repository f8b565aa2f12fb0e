//! Results are values first: what a job keeps as files is what its function gives, which writes nothing.

use std::path::Path;
use std::sync::Arc;

use petzval_jobs::isp::develop;
use petzval_jobs::{Context, Silent, built_in_assets, psf, simulate};

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
fn frames_and_developed_pictures_are_what_the_files_hold() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("taken");
    let request = simulate::Request {
        images: vec!["scene:slanted-edge".into()],
        size: Some((32, 32)),
        spectral: simulate::Spectral { qe: Some("imx219".to_owned()), ..simulate::Spectral::default() },
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
    assert_eq!(developed.len(), frame.taken.developed.data.len());

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
