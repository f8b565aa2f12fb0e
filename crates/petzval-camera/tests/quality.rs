//! Compares PSNR and SSIM with scikit-image 0.26.0 (see `fixtures/README.md`).

use std::path::PathBuf;

use petzval_camera::{psnr, ssim_gaussian_wang};
use petzval_files::load_image;
use serde_json::Value;

fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/iqa").join(name)
}

fn values() -> Value {
    serde_json::from_str(&std::fs::read_to_string(fixture("values.json")).unwrap()).unwrap()
}

#[test]
fn pictures_score_as_in_scikit_image() {
    for pair in values()["pairs"].as_array().unwrap() {
        let read = |key: &str| load_image(&fixture(pair[key].as_str().unwrap())).unwrap().light;
        let (a, b) = (read("reference"), read("test"));
        let (a_srgb, b_srgb) = (a.to_srgb(), b.to_srgb());
        let psnr_db = psnr(&a_srgb, &b_srgb).unwrap();
        let ssim = ssim_gaussian_wang(&a_srgb, &b_srgb, a.channels, a.height, a.width).unwrap();
        assert!((psnr_db - pair["psnr_db"].as_f64().unwrap()).abs() < 1e-4, "{pair}: {psnr_db}");
        assert!((ssim - pair["ssim"].as_f64().unwrap()).abs() < 1e-4, "{pair}: {ssim}");
    }
}

#[test]
fn the_tiny_pair_scores_as_in_scikit_image() {
    let tiny = &values()["tiny"];
    let read = |key: &str| -> Vec<f32> {
        let rows = tiny[key].as_array().unwrap().iter().flat_map(|row| row.as_array().unwrap());
        rows.map(|v| v.as_f64().unwrap() as f32 / 255.0).collect()
    };
    let (a, b) = (read("a"), read("b"));
    assert!((psnr(&a, &b).unwrap() - tiny["psnr"].as_f64().unwrap()).abs() < 1e-5);
    let ssim = ssim_gaussian_wang(&a, &b, 1, 16, 16).unwrap();
    assert!((ssim - tiny["ssim_gauss"].as_f64().unwrap()).abs() < 1e-5, "{ssim}");
}
