//! `simulate` and training develop alike: the same raw frame becomes the same picture, to the last bit.

use std::path::Path;
use std::sync::Arc;

use burn::prelude::*;
use burn::tensor::TensorData;
use petzval_camera::image::LinearImage;
use petzval_camera::render::Window;
use petzval_camera::sensor::{Noise, NoiseMode};
use petzval_design::camera::{Labels, Shot, to_host};
use petzval_design::experiment::{DevelopmentConfig, Experiment};
use petzval_design::setup::Setup;
use petzval_files::save_png;
use petzval_jobs::{Context, Silent, built_in_assets, simulate};
use petzval_learn::Device;

const SIDE: usize = 96;

fn npy<T: npyz::Deserialize>(path: &Path) -> Vec<T> {
    npyz::NpyFile::new(&std::fs::read(path).unwrap()[..]).unwrap().into_vec().unwrap()
}

#[test]
fn simulate_and_training_develop_a_raw_frame_to_the_same_bits() {
    let context = Context::new(built_in_assets(), Arc::new(Silent));
    let folder = tempfile::tempdir().unwrap();
    let photo: Vec<f32> =
        (0..3 * 200 * 320).map(|i| (i as f32 * 0.37).sin().abs() * ((i % 320) as f32 / 320.0)).collect();
    let photo = LinearImage::from_data(3, 200, 320, photo).unwrap();
    save_png(&photo, &folder.path().join("photo.png")).unwrap();
    // At the default exposure nothing is clipped; at four times of it, highlights are.
    for (white_e, clips) in [(16_000.0, false), (64_000.0, true)] {
        let request = simulate::Request {
            images: vec![folder.path().join("photo.png")],
            white_e: Some(white_e),
            size: Some((SIDE, SIDE)),
            raw_format: simulate::RawAs::Npy,
            picture_format: simulate::PictureAs::Npy,
            out: folder.path().join(white_e.to_string()),
            ..simulate::Request::default()
        };
        let facts = &simulate::run(&request, &context).unwrap().images[0];
        assert_eq!(facts["saturated_share"].as_f64().unwrap() > 0.01, clips);
        let file = |key: &str| Path::new(facts[key].as_str().unwrap()).to_path_buf();
        let raw: Vec<u16> = npy(&file("raw"));
        let shown: Vec<f32> = npy(&file("developed"));

        // The camera that a network would be trained behind, of the same lens, sensor and exposure.
        let mut experiment = Experiment::default();
        experiment.exposure.white_e = white_e;
        let simulate::Interpolation { demosaic, domain } = request.development;
        experiment.development = DevelopmentConfig { demosaic, domain, restore: false };
        let setup = Setup::without_windows(experiment, &context.assets, Device::flex().autodiff()).unwrap();
        let lens = context.assets.lens("cooke-triplet-nominal").unwrap().lens;
        let camera = setup.camera(lens, false).unwrap();
        let sensor = &camera.body().sensor;
        let window = Window::middle((sensor.height, sensor.width), (2, 2), SIDE, SIDE).unwrap();
        let side = SIDE + 2 * camera.border();
        let scene = LinearImage::filled(3, side, side, 0.5);
        let shot = Shot {
            scene,
            placement: window.placement,
            kept: None,
            frame: 0,
            labels: Labels::default(),
            follows_light: true,
        };
        let off = Noise { mode: NoiseMode::Off, seed: 0 };
        let light = camera.take(std::slice::from_ref(&shot), &off).unwrap().illumination;
        let dn: Vec<f32> = raw.into_iter().map(f32::from).collect();
        let dn = Tensor::<4>::from_data(TensorData::new(dn, [1, 1, SIDE, SIDE]), &camera.body().device);
        let developed = camera.develop(dn, light, &[camera.capture(&shot)]).unwrap();
        assert!(to_host(developed).unwrap() == shown, "white_e {white_e}: the pictures differ");
    }
}
