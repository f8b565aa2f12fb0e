//! Round trips of spectral images, and damaged files.

use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::exr_file::wavelength_um;
use super::*;
use crate::{exr_bytes, npy_bytes};

fn image() -> SpectralImage {
    let data = (0..4 * 5 * 7).map(|i| (i as f32).sqrt() / 16.0).collect();
    SpectralImage { wavelength_um: vec![0.4, 0.4505, 0.55, 0.7], height: 5, width: 7, data }
}

/// A TIFF of one gray page per band.
fn tiff_pages(image: &SpectralImage) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut out).unwrap();
    for band in 0..image.bands() {
        encoder
            .write_image::<tiff::encoder::colortype::Gray32Float>(
                image.width as u32,
                image.height as u32,
                image.plane(band),
            )
            .unwrap();
    }
    out.into_inner()
}

/// An array `[bands, rows, columns]` of 32-bit floats.
fn npy(image: &SpectralImage) -> Vec<u8> {
    let shape = [image.bands(), image.height, image.width].map(|n| n as u64);
    npy_bytes(&shape, &image.data).unwrap()
}

/// A channel `S0.<nm>nm` a band, with a decimal comma, the layout of Fichet et al.
fn exr(image: &SpectralImage) -> Vec<u8> {
    let name = |um: &f64| format!("S0.{}nm", format!("{:.6}", um * 1000.0).replace('.', ","));
    let names: Vec<String> = image.wavelength_um.iter().map(name).collect();
    let planes = names.iter().enumerate().map(|(band, name)| (name.as_str(), image.plane(band)));
    exr_bytes(image.height, image.width, &planes.collect::<Vec<_>>()).unwrap()
}

fn sidecar(folder: &Path, name: &str, text: &str) {
    std::fs::write(folder.join(name), text).unwrap();
}

const WAVELENGTHS: &str = "wavelength_um = [0.4, 0.4505, 0.55, 0.7]\n";

#[test]
fn npy_and_exr_hold_the_same_image() {
    let folder = tempfile::tempdir().unwrap();
    sidecar(folder.path(), "a.toml", WAVELENGTHS);
    for (name, bytes) in [("a.npy", npy(&image())), ("b.exr", exr(&image()))] {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        assert!(is_spectral(&path));
        let back = load_spectral(&path).unwrap();
        assert_eq!(back.data, image().data, "{name}");
        let close = back.wavelength_um.iter().zip(image().wavelength_um).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(close, "{:?}", back.wavelength_um);
    }
}

#[test]
fn bands_may_be_the_last_axis_and_scaled() {
    let folder = tempfile::tempdir().unwrap();
    let (image, path) = (image(), folder.path().join("b.npy"));
    let turned: Vec<f64> = (0..5 * 7 * 4).map(|i| f64::from(image.plane(i % 4)[i / 4]) * 1000.0).collect();
    let mut bytes = Vec::new();
    {
        use npyz::WriterBuilder;
        let mut writer = npyz::WriteOptions::new()
            .default_dtype()
            .shape(&[5, 7, 4])
            .writer(&mut bytes)
            .begin_nd()
            .unwrap();
        writer.extend(turned).unwrap();
        writer.finish().unwrap();
    }
    std::fs::write(&path, bytes).unwrap();
    sidecar(folder.path(), "b.toml", &format!("{WAVELENGTHS}axes = \"bands_last\"\nscale = 1e-3\n"));
    let back = load_spectral(&path).unwrap();
    assert!(back.data.iter().zip(&image.data).all(|(a, b)| (a - b).abs() < 1e-6));

    sidecar(folder.path(), "b.toml", WAVELENGTHS);
    let error = load_spectral(&path).unwrap_err().to_string();
    assert!(error.contains("5 bands, but 4 wavelengths") && error.contains("axes"), "{error}");
}

#[test]
fn tiff_pages_and_samples_are_bands() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.tif");
    std::fs::write(&path, tiff_pages(&image())).unwrap();
    assert!(!is_spectral(&path));
    assert!(matches!(load_spectral(&path), Err(SpectralFileError::NoSidecar { .. })));
    sidecar(folder.path(), "c.toml", WAVELENGTHS);
    assert!(is_spectral(&path));
    assert_eq!(load_spectral(&path).unwrap(), image());

    // Three samples of one page.
    let mut out = std::io::Cursor::new(Vec::new());
    let samples: Vec<u16> = (0..2 * 2 * 3).collect();
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut out).unwrap();
    encoder.write_image::<tiff::encoder::colortype::RGB16>(2, 2, &samples).unwrap();
    std::fs::write(&path, out.into_inner()).unwrap();
    sidecar(folder.path(), "c.toml", "wavelength_um = [0.45, 0.55, 0.65]\nscale = 0.5\n");
    let back = load_spectral(&path).unwrap();
    assert_eq!(back.plane(1), [0.5, 2.0, 3.5, 5.0]);
    sidecar(folder.path(), "c.toml", WAVELENGTHS);
    assert!(load_spectral(&path).unwrap_err().to_string().contains("3 bands, but 4 wavelengths"));
}

#[test]
fn the_unit_of_an_exr_is_read_and_its_sidecar_scales_it() {
    use exr::prelude::{
        AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image, Layer, LayerAttributes, Text,
        WritableImage,
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("d.exr");
    let write = |unit: Option<&str>| {
        let band = |name, value| AnyChannel::new(name, FlatSamples::F32(vec![value; 6]));
        let channels = AnyChannels::sort(vec![band("S0.400nm", 1.0), band("S0.500nm", 2.0)].into());
        let mut attributes = LayerAttributes::default();
        if let Some(unit) = unit {
            let name = Text::new_or_none("emissiveUnits").unwrap();
            attributes.other.insert(name, AttributeValue::Text(Text::new_or_none(unit).unwrap()));
        }
        let layer = Layer::new((3, 2), attributes, Encoding::FAST_LOSSLESS, channels);
        Image::from_layer(layer).write().to_file(&path).unwrap();
    };
    for unit in [None, Some("W.m^-2.sr^-1"), Some("W m^-2 sr^-1 nm^-1")] {
        write(unit);
        assert_eq!(load_spectral(&path).unwrap().plane(1)[0], 2.0);
    }
    write(Some("W.m^-2.sr^-1.m^-1"));
    let error = load_spectral(&path).unwrap_err().to_string();
    assert!(error.contains("W.m^-2.sr^-1.m^-1") && error.contains("scale"), "{error}");
    sidecar(folder.path(), "d.toml", "scale = 0.25\n");
    assert_eq!(load_spectral(&path).unwrap().plane(1)[0], 0.5);
    for (text, needle) in [("scale = -1\n", "not positive"), ("wave = 3\n", "no such key")] {
        sidecar(folder.path(), "d.toml", text);
        let error = load_spectral(&path).unwrap_err();
        assert!(
            matches!(error, SpectralFileError::Sidecar { .. }) && error.to_string().contains(needle),
            "{error}"
        );
    }
}

#[test]
fn names_of_channels_hold_wavelengths() {
    for (name, um) in [
        ("S0.450,500000nm", Some(0.4505)),
        ("S0.450nm", Some(0.45)),
        ("700nm", Some(0.7)),
        ("612.5nm", Some(0.6125)),
        ("w550", Some(0.55)),
        ("S1.450nm", None),
        ("T.450nm", None),
        ("R", None),
        ("550", None),
        ("5nm", None),
        ("", None),
    ] {
        assert_eq!(wavelength_um(name), um, "{name}");
    }
}

#[test]
fn wrong_sidecars_name_key_and_line() {
    for (text, key, needle) in [
        ("wavelength_um = [0.5]\n", "wavelength_um", "two ascending"),
        ("wavelength_um = [400, 500, 600, 700]\n", "wavelength_um", "0.4 um"),
        ("wavelength_um = [0.4, 0.5]\nscale = 0\n", "scale", "not positive"),
        ("wavelength_um = [0.4, 0.5]\nunit = \"lux\"\n", "unit", "W m-2"),
        ("wavelength_um = [0.4, 0.5]\naxes = \"xyz\"\n", "axes", "bands_first"),
        ("wave = 3\n", "wave", "wavelength_um"),
    ] {
        let error = Sidecar::parse(text).unwrap_err();
        assert_eq!(error.key, key, "{error}");
        assert!(error.to_string().contains(needle), "{error}");
    }
}

/// Changes one to five bytes, or truncates the file.
fn damage(bytes: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for _ in 0..rng.random_range(1..6) {
        let at = rng.random_range(0..out.len());
        match rng.random_range(0..5) {
            0 => out.truncate(at.max(1)),
            1 => out[at] = 0xff,
            2 => out[at] = rng.random(),
            3 => out[at] ^= 1 << rng.random_range(0..8),
            _ => {
                // Damage the header more often.
                let near = at % 400.min(out.len());
                out[near] = rng.random();
            }
        }
    }
    out
}

#[test]
fn damaged_files_are_refused_or_read_but_never_panic() {
    let count = std::env::var("PETZVAL_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(20_000usize);
    let sidecar = Sidecar::parse(WAVELENGTHS).unwrap();
    let (npy, exr, tif) = (npy(&image()), exr(&image()), tiff_pages(&image()));
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut read = [0usize; 3];
    for _ in 0..count / 3 {
        read[0] += usize::from(npy_file::read(&damage(&npy, &mut rng), &sidecar).is_ok());
        read[1] += usize::from(exr_file::read(&damage(&exr, &mut rng), None).is_ok());
        read[2] += usize::from(tiff_file::read(&damage(&tif, &mut rng), &sidecar).is_ok());
    }
    // Damage to values alone leaves a readable file, damage to headers does not.
    assert!(read.iter().all(|n| *n > 0 && *n < count / 3));
}
