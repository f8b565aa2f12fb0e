//! `petzval psf-calibrate`: PSFs measured from captures of a pinhole.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use indicatif::{ProgressBar, ProgressStyle};
use petzval::base::FileError;
use petzval::base::write_whole;
use petzval::built_in_assets;
use petzval::camera::image::CHANNELS;
use petzval::camera::psf::PsfBank;
use petzval::camera::sensor::{CfaPattern, SensorModel};
use petzval::design::error::DesignError;
use petzval::design::pinhole::{PinholeView, Refocus};
use petzval::files::npy_bytes;
use petzval::lab::psf_calibration::compare::{Comparison, compare};
use petzval::lab::psf_calibration::estimate::{Place, estimate_bank};
use petzval::lab::psf_calibration::held_out::HeldOutBy;
use petzval::lab::psf_calibration::manifest::Manifest;
use petzval::lab::psf_calibration::measure::{COLOURS, check_mosaic};
use petzval::lab::psf_calibration::psf_file::save_psfs;
use petzval::lab::psf_calibration::{
    CROP, CalibratedPosition, PsfCalibrationError, calibrate_position, read_manifest,
};
use petzval::report::psf_calibration_sheet::{Calibration, page, sheet_png};
use serde_json::json;

use super::{Failure, print_json};

/// Measure point-spread functions from captures of a pinhole.
///
/// DIR holds captures.toml, which names sensor, positions, exposures and frames (`petzval psf-capture` writes one to look at).
/// Per position the frames of each exposure are averaged, the dark signal is taken off, exposures are merged by their variance,
/// the mosaic is filled bilinearly, and 23x23 pixels around the centroid are kept. With --lens every PSF is
/// compared with the traced one, and errors stand beside the predicted noise floor. Fields of the bank are tested on positions
/// that were left out of their fit; a lone position can only be tested on parts of its own pixels.
///
/// The sensor has a Bayer mosaic, or none: the one PSF of a monochrome sensor then stands in all three channels. Other
/// mosaics are refused.
///
/// Files: calibration.json, all figures; psf-calibration.html, a page to look at; psf-calibration.png, all PSFs on a sheet;
/// measured.npy, float64 [position, channel, row, column]; psfs.toml and psfs.npy, what `simulate --psfs` takes in place of a
/// traced lens.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of captures, with captures.toml
    #[arg(value_name = "DIR")]
    captures: PathBuf,
    /// Lens to compare with: a file, or a built-in name
    #[arg(long)]
    lens: Option<String>,
    /// Folder for the results; DIR/psf-calibration if not given
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seed of the draws behind the noise floor
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print all figures as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let folder = &args.captures;
    let fail = |error| failure(error, folder);
    let (manifest, text, path) = read_manifest(folder).map_err(fail)?;
    let sensor = sensor(&manifest, &text, &path)?;
    check_mosaic(sensor.cfa).map_err(fail)?;
    let view = args.lens.as_ref().map(|name| view(name, &manifest, &sensor)).transpose()?;

    let frames: usize = manifest
        .position
        .iter()
        .flat_map(|p| &p.exposure)
        .map(|e| e.frames.get_ref().len() + e.dark_frames.len())
        .sum();
    let bar = ProgressBar::new(frames as u64);
    if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:30}] {pos}/{len} frames, {eta} left") {
        bar.set_style(style);
    }
    let mut positions: Vec<(CalibratedPosition, Option<Comparison>)> = Vec::new();
    for index in 0..manifest.position.len() {
        bar.set_message(manifest.position[index].name.get_ref().clone());
        let seed = args.seed.wrapping_add(index as u64);
        let position = calibrate_position((&manifest, &text), folder, index, &sensor, seed, || bar.inc(1))
            .map_err(fail)?;
        let comparison = match &view {
            Some(view) => {
                let simulated = view.psf(position.field_radius_mm)?.psf;
                let (azimuth, expected) = (position.azimuth_rad, position.expected_px);
                let compared = compare(
                    &position.measured,
                    &position.frame,
                    &simulated,
                    sensor.pixel_um,
                    azimuth,
                    expected,
                    &position.name,
                );
                Some(compared.map_err(fail)?)
            }
            None => None,
        };
        positions.push((position, comparison));
    }
    bar.set_message("fitting the bank");

    // A turned camera lacks three of a flat scene's cosines.
    let scale_mm = manifest.source.image_scale_mm.as_ref().map(|mm| *mm.get_ref());
    let light_factor = |radius_mm: f64| match (manifest.source.camera_turned, scale_mm) {
        (true, Some(scale)) => (radius_mm / scale).atan().cos().powi(3),
        _ => 1.0,
    };
    if manifest.source.camera_turned && scale_mm.is_none() {
        eprintln!(
            "warning: {}: the camera was turned, but `image_scale_mm` is not given: relative illumination lacks a factor cos^3",
            path.display()
        );
    }
    let places: Vec<Place> = positions
        .iter()
        .map(|(p, _)| Place {
            field_radius_mm: p.field_radius_mm,
            azimuth_rad: p.azimuth_rad,
            light_factor: light_factor(p.field_radius_mm),
            frame: &p.frame,
            merged: &p.merged,
            measured: &p.measured,
        })
        .collect();
    let (bank, fields) =
        estimate_bank(&places, sensor.pixel_um).map_err(|e| fail(PsfCalibrationError::Bank(e)))?;
    bar.finish_and_clear();
    let calibration = Calibration {
        captures: folder.display().to_string(),
        sensor: sensor.name.clone(),
        lens: args.lens.clone(),
        positions,
        fields,
    };
    for (position, _) in &calibration.positions {
        for warning in position.warnings.iter().filter(|w| !w.starts_with("no dark frames")) {
            eprintln!("warning: {}: {warning}", position.name);
        }
    }
    tell_of_bank(&calibration);
    let out = args.out.clone().unwrap_or_else(|| folder.join("psf-calibration"));
    let figures = figures(&calibration, &bank, &sensor);
    write_all(&out, &calibration, &bank, &figures)?;
    if args.json {
        return print_json(&figures);
    }
    print!("{}", summary(&calibration));
    println!("\nresults in {}; open psf-calibration.html", out.display());
    Ok(ExitCode::SUCCESS)
}

/// What the user sees of a failure; `place` is the folder of captures.
pub(super) fn failure(error: PsfCalibrationError, place: &Path) -> Failure {
    match error {
        PsfCalibrationError::File { path, error } => DesignError::Input { path, error }.into(),
        PsfCalibrationError::Io { path, error } if error.kind() == std::io::ErrorKind::NotFound => {
            Failure::input(
                format!("{}: {error}", path.display()),
                "a folder of captures holds captures.toml and the frames it names; `petzval psf-capture` makes one",
            )
        }
        PsfCalibrationError::Io { path, error } => DesignError::io(&path)(error).into(),
        other => {
            let text = other.to_string();
            match text.split_once("; hint: ") {
                Some((message, hint)) => Failure::input(message, hint),
                None => Failure::input(text, format!("the captures are described in {}", place.display())),
            }
        }
    }
}

/// The sensor that the manifest names: a file beside it, or a built-in one.
fn sensor(manifest: &Manifest, text: &str, path: &Path) -> Result<SensorModel, Failure> {
    let beside = path.parent().unwrap_or(Path::new("")).join(&manifest.sensor);
    let name = if beside.is_file() { beside.display().to_string() } else { manifest.sensor.clone() };
    built_in_assets().sensor(&name).map_err(|error| match error {
        DesignError::Unknown { .. } => {
            let at = FileError::at_key(text, &["sensor"], error.to_string());
            DesignError::Input {
                path: path.to_owned(),
                error: Box::new(at.hint("a built-in sensor, or a sensor file beside this one")),
            }
            .into()
        }
        other => other.into(),
    })
}

/// The lens as the manifest says that it was used.
fn view(name: &str, manifest: &Manifest, sensor: &SensorModel) -> Result<PinholeView, Failure> {
    let lens = built_in_assets().lens(name)?.lens;
    let source = &manifest.source;
    let distance_mm = source.distance_mm.as_ref().map(|mm| *mm.get_ref());
    let refocus = source.refocus_mm.as_ref().map_or(Refocus::OnSource, |mm| Refocus::Mm(*mm.get_ref()));
    let view =
        PinholeView::new(&lens, sensor, distance_mm, source.pinhole_um, source.camera_turned, refocus)?;
    Ok(view)
}

/// What of the bank was not confirmed, field by field.
fn tell_of_bank(calibration: &Calibration) {
    let told: Vec<(f64, String)> = calibration
        .fields
        .iter()
        .flat_map(|f| f.warnings().into_iter().map(|w| (f.field_radius_mm, w)))
        .collect();
    if told.is_empty() {
        return;
    }
    for (radius_mm, warning) in &told {
        eprintln!("warning: bank, {radius_mm:.2} mm: {warning}");
    }
    eprintln!(
        "warning: the bank is a smooth estimate, not the PSF below a pixel: between azimuths and sub-pixel phases that were captured it \
         is good to the held-out L1; hint: more positions of a radius, at other azimuths and phases, lower it"
    );
}

fn figures(calibration: &Calibration, bank: &PsfBank, sensor: &SensorModel) -> serde_json::Value {
    let positions: Vec<serde_json::Value> = calibration
        .positions
        .iter()
        .enumerate()
        .map(|(index, (p, comparison))| {
            let m = &p.measured;
            let middle = calibration.fields.iter().flat_map(|f| &f.middle_px).find(|m| m.0 == index);
            let origin = [p.frame.placement.row as f64, p.frame.placement.col as f64];
            let on_sensor = |at: [f64; 2]| [origin[0] + at[0], origin[1] + at[1]];
            json!({
                "name": p.name,
                "field_radius_mm": p.field_radius_mm,
                "azimuth_deg": p.azimuth_rad.to_degrees(),
                "centroid_px": m.psf.centroid_px.map(on_sensor),
                "centroid_standard_error_px": m.centroid_se_px,
                "bank_middle_px": middle.map(|m| on_sensor(m.1)),
                "crop_origin": [p.frame.placement.row + m.psf.corner.0, p.frame.placement.col + m.psf.corner.1],
                "light_e_per_s": m.psf.light_e_per_s,
                "background_e_per_s": m.background_e_per_s,
                "noise_floor": { "l1": m.floor.l1, "centroid_px": m.floor.centroid_px, "light": m.floor.light },
                "exposures": p.exposures.iter().map(|e| json!({
                    "exposure_ms": e.exposure_ms,
                    "frames": e.frames,
                    "dark_frames": e.dark_frames,
                    "saturated_pixels": e.saturated_pixels,
                    "variance_ratio": e.variance_ratio,
                    "agreement": e.agreement.map(|a| json!({
                        "light_over_others": a.ratio,
                        "chi2": a.chi2,
                        "pixels": a.pixels,
                    })),
                })).collect::<Vec<_>>(),
                "simulated": comparison.as_ref().map(|c| json!({
                    "l1": c.l1,
                    "l1_ideal_pixels": c.l1_ideal,
                    "l1_of_demosaicing": c.demosaic_l1,
                    "centroid_error_same_mosaic_px": c.centroid_error_px,
                    "centroid_error_ideal_pixels_px": c.centroid_error_ideal_px,
                    "centroid_ideal_pixels_px": c.ideal_centroid_px.map(on_sensor),
                    "place_is_known": c.is_placed,
                })),
                "warnings": p.warnings,
            })
        })
        .collect();
    json!({
        "captures": calibration.captures,
        "sensor": calibration.sensor,
        "lens": calibration.lens,
        "pixel_um": sensor.pixel_um,
        "crop": CROP,
        "channels": if sensor.cfa == CfaPattern::MONO { ["clear"; CHANNELS] } else { COLOURS },
        "positions": positions,
        "bank": {
            "field_radius_mm": bank.field_radius_mm,
            "grid": bank.grid,
            "pitch_um": bank.pitch_um,
            "illumination": bank.illumination.chunks(3).collect::<Vec<_>>(),
            "fit": calibration.fields.iter().map(|f| json!({
                "field_radius_mm": f.field_radius_mm,
                "positions": f.positions,
                "chi2": f.chi2,
                "held_out": {
                    "by": match f.held_out.by {
                        HeldOutBy::Positions => "positions",
                        HeldOutBy::Pixels => "pixels",
                    },
                    "chi2": f.held_out.score.map(|s| s.chi2()),
                    "l1": f.held_out.score.map(|s| s.l1()),
                    "l1_of_noise": f.held_out.score.map(|s| s.noise_l1()),
                },
                "blob_px": f.blob_px,
                "rounds": f.rounds,
                "starts_from_green": f.is_from_green,
                "warnings": f.warnings(),
            })).collect::<Vec<_>>(),
        },
    })
}

fn write_all(
    out: &Path,
    calibration: &Calibration,
    bank: &PsfBank,
    figures: &serde_json::Value,
) -> Result<(), Failure> {
    Failure::folder(out)?;
    let wrong = |e| failure(e, out);
    let text = serde_json::to_string_pretty(figures).map_err(|e| Failure::job(e.to_string()))?;
    let write = |name: &str, bytes: &[u8]| {
        let path = out.join(name);
        write_whole(&path, bytes).map_err(DesignError::io(&path))
    };
    let shape = [calibration.positions.len() as u64, 3, CROP as u64, CROP as u64];
    let psfs = calibration.positions.iter().flat_map(|(p, _)| p.measured.psf.values.iter().flatten());
    let psfs: Vec<f64> = psfs.copied().collect();
    let npy = npy_bytes(&shape, &psfs).map_err(|e| Failure::job(format!("measured.npy: {e}")))?;
    write("measured.npy", &npy)?;
    write("psf-calibration.png", &sheet_png(calibration))?;
    write("psf-calibration.html", page(calibration).as_bytes())?;
    save_psfs(bank, &format!("measured: {}", calibration.captures), out).map_err(wrong)?;
    Ok(write("calibration.json", text.as_bytes())?)
}

/// A few lines for people.
fn summary(calibration: &Calibration) -> String {
    let mut out = format!("{}: {} positions\n\n", calibration.captures, calibration.positions.len());
    out += "  position             centroid px       +-      L1 floor G";
    if calibration.lens.is_some() {
        out += "   L1 G   of demosaicing   centroid error px: same mosaic, ideal pixels";
    }
    out += "\n";
    for (p, comparison) in &calibration.positions {
        let m = &p.measured;
        let at = [
            p.frame.placement.row as f64 + m.psf.centroid_px[1][0],
            p.frame.placement.col as f64 + m.psf.centroid_px[1][1],
        ];
        let error = m.centroid_se_px[0].hypot(m.centroid_se_px[1]);
        out +=
            &format!("  {:<16} {:>8.2} {:>8.2}   {error:.4}     {:.4}", p.name, at[0], at[1], m.floor.l1[1]);
        if let Some(c) = comparison {
            let off = |error: [f64; 2]| match c.is_placed {
                true => format!("{:.4}", error[0].hypot(error[1])),
                false => "-".into(),
            };
            out += &format!(
                "     {:.4}     {:.4}           {:<13}{}",
                c.l1[1],
                c.demosaic_l1[1],
                off(c.centroid_error_px[1]),
                off(c.centroid_error_ideal_px[1])
            );
        }
        out += "\n";
    }
    out += "\n  bank       positions   chi2 R, G, B         held-out L1 R, G, B      of noise\n";
    for f in &calibration.fields {
        let three = |of: &dyn Fn(usize) -> f64, digits: usize| {
            [0, 1, 2].map(|c| format!("{:.digits$}", of(c))).join(" ")
        };
        let by = if f.held_out.by == HeldOutBy::Pixels { "  (parts of the only position)" } else { "" };
        let score = &f.held_out.score;
        out += &format!(
            "  {:>5.2} mm   {:>9}   {:<18}   {:<22}   {}{by}\n",
            f.field_radius_mm,
            f.positions,
            three(&|c| f.chi2[c], 2),
            three(&|c| score[c].l1(), 3),
            three(&|c| score[c].noise_l1(), 3),
        );
    }
    out
}
