//! `petzval psf-capture`: simulated captures of a pinhole, as a laboratory would take them.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use petzval::base::write_whole;
use petzval::built_in_assets;
use petzval::camera::render::Placement;
use petzval::camera::sensor::{Noise, NoiseMode, SensorModel};
use petzval::design::error::DesignError;
use petzval::design::pinhole::{PinholePsf, PinholeView, Refocus};
use petzval::files::raw_file::{RawFormat, RawFrame, save_raw_alone};
use petzval::lab::psf_calibration::capture::{WindowLight, take_frame};
use petzval::lab::psf_calibration::manifest::{
    ExposureFiles, MANIFEST_FILE, Manifest, Position, Source, unspanned,
};
use petzval::lab::psf_calibration::measure::check_mosaic;
use petzval::lab::psf_calibration::{CROP, FinePsf, Spot};
use serde_json::json;

use super::{Failure, print_json, psf_calibrate};

/// Where the lens is focused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Focus {
    /// On the source: the sensor moves as far as the paraxial image.
    Source,
    /// Where the lens file has it, for most lenses at infinity: a near source is then out of focus.
    File,
}

/// A direction from the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Axis {
    /// Along the columns of the sensor, downwards.
    Vertical,
    /// Along its rows, to the right.
    Horizontal,
    /// To its corner.
    Diagonal,
}

/// Simulate captures of a pinhole: frames and their manifest, ready for psf-calibrate.
///
/// A pinhole lit by a white diode of 4900 K is put at field radii along the vertical, horizontal and diagonal of the
/// sensor; fields that the sensor does not reach are left out. The camera turns towards the source. At each place frames are
/// taken at several exposure times with the sensor's noise; only a window around the source is written. The source is
/// adjusted so that the brightest pixel of all places, behind its own colour filter, is at --peak of the range at the longest
/// time. A folder that holds captures is left as it is.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    lens: String,
    /// Folder for the captures
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Sensor file, or a built-in name
    #[arg(long, default_value = "imx249-calibrated")]
    sensor: String,
    /// Distance of the pinhole from the lens, mm
    #[arg(long, default_value_t = 1500.0)]
    distance_mm: f64,
    /// Diameter of the pinhole, um; its image may be a pixel wide
    #[arg(long, default_value_t = 75.0, allow_negative_numbers = true)]
    pinhole_um: f64,
    /// Where the lens is focused
    #[arg(long, value_enum, default_value = "source")]
    focus: Focus,
    /// Fields from the axis to --radius-mm
    #[arg(long, default_value_t = 9)]
    fields: usize,
    /// Image radius of the last field, mm
    #[arg(long, default_value_t = 6.4)]
    radius_mm: f64,
    /// Directions in which the source is moved
    #[arg(
        long,
        value_enum,
        value_name = "AXIS,AXIS,...",
        value_delimiter = ',',
        default_value = "vertical,horizontal,diagonal"
    )]
    axes: Vec<Axis>,
    /// Exposure times, ms, the shortest first
    #[arg(long, value_name = "MS,MS,...", value_delimiter = ',', default_value = "1,4,16")]
    exposures_ms: Vec<f64>,
    /// Frames of each exposure time
    #[arg(long, default_value_t = 20)]
    frames: usize,
    /// Dark frames of each exposure time and place
    #[arg(long, default_value_t = 0)]
    dark_frames: usize,
    /// Brightest pixel at the longest exposure over the range of converter or full well, the lesser; above 1 it clips
    #[arg(long, default_value_t = 0.8)]
    peak: f64,
    /// Pixels a side of the window that is written
    #[arg(long, default_value_t = 64)]
    window: usize,
    /// Seed of noise and of how far the alignment is off (up to half a pixel)
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print what was taken as JSON
    #[arg(long)]
    json: bool,
}

/// A place of the source. Its light is landed when it is asked for: windows of many places together fill the memory.
struct Place<'a> {
    name: String,
    field_radius_mm: f64,
    azimuth_deg: f64,
    chief_px: [f64; 2],
    psf: &'a FinePsf,
    spot: Spot,
    placement: Placement,
}

impl Place<'_> {
    /// The PSF's light on a window of `side` pixels, `scale` times as bright.
    fn light(&self, side: usize, pixel_um: f64, scale: f64) -> WindowLight {
        let mut rate_e_per_s = self.psf.land(self.spot, pixel_um, (side, side));
        rate_e_per_s.iter_mut().flatten().for_each(|v| *v *= scale);
        WindowLight { height: side, width: side, placement: self.placement, rate_e_per_s }
    }
}

/// Runs the verb.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    check(&args)?;
    let assets = built_in_assets();
    let lens = assets.lens(&args.lens)?.lens;
    let sensor = assets.sensor(&args.sensor)?;
    check_mosaic(sensor.cfa).map_err(|error| psf_calibrate::failure(error, &args.out))?;
    let refocus = match args.focus {
        Focus::Source => Refocus::OnSource,
        Focus::File => Refocus::Mm(0.0),
    };
    let view = PinholeView::new(&lens, &sensor, Some(args.distance_mm), args.pinhole_um, true, refocus)?;
    let psfs = radii_mm(&args).map(|radius| Ok((radius, view.psf(radius)?)));
    let psfs: Vec<(f64, PinholePsf)> = psfs.collect::<Result<_, DesignError>>()?;
    let places = places(&args, &psfs, &sensor)?;
    let scale = brightness(&args, &sensor, &places);
    Failure::folder(&args.out)?;
    let manifest = Manifest {
        sensor: sensor_name(&args)?,
        linear_gain: unspanned(1.0),
        source: Source {
            distance_mm: Some(unspanned(args.distance_mm)),
            pinhole_um: args.pinhole_um,
            camera_turned: true,
            image_scale_mm: Some(unspanned(view.image_scale_mm)),
            refocus_mm: Some(unspanned(view.refocus_mm)),
        },
        position: take_all(&args, &sensor, &places, scale)?,
    };
    let path = args.out.join(MANIFEST_FILE);
    let text = manifest.to_toml().map_err(|e| Failure::job(format!("{}: {e}", path.display())))?;
    let head = format!("# Simulated: {} through {}.\n", sensor.name, lens.name);
    write_whole(&path, format!("{head}{text}").as_bytes()).map_err(DesignError::io(&path))?;
    let per_place = args.exposures_ms.len() * (args.frames + args.dark_frames);
    eprintln!(
        "{} positions, {} frames in {}; measure them with `petzval psf-calibrate {} --lens {}`",
        places.len(),
        places.len() * per_place,
        args.out.display(),
        args.out.display(),
        args.lens
    );
    if args.json {
        return print_json(&json!({
            "manifest": path.display().to_string(),
            "refocus_mm": view.refocus_mm,
            "image_scale_mm": view.image_scale_mm,
            "pinhole_image_um": view.disc_um,
            "positions": places.iter().map(|p| json!({
                "name": p.name,
                "field_radius_mm": p.field_radius_mm,
                "azimuth_deg": p.azimuth_deg,
                "chief_ray_px": p.chief_px,
            })).collect::<Vec<_>>(),
        }));
    }
    Ok(ExitCode::SUCCESS)
}

fn check(args: &Args) -> Result<(), Failure> {
    for (name, ok, hint) in [
        ("--distance-mm", (10.0..=1e7).contains(&args.distance_mm), "10 mm to 10 km; the paper has 1500"),
        ("--pinhole-um", (0.0..=1e4).contains(&args.pinhole_um), "a diameter in um; 0 for a point"),
        ("--fields", (1..=99).contains(&args.fields), "1 to 99 fields"),
        ("--radius-mm", args.radius_mm > 0.0 && args.radius_mm < 1e3, "an image radius in mm"),
        ("--frames", (1..=1000).contains(&args.frames), "1 to 1000 frames"),
        ("--dark-frames", args.dark_frames <= 1000, "0 to 1000 frames"),
        ("--peak", (0.001..=1000.0).contains(&args.peak), "0.8 uses the range well and does not clip"),
        ("--window", (48..=1024).contains(&args.window), "48 to 1024 pixels"),
        (
            "--exposures-ms",
            args.exposures_ms.iter().all(|t| (1e-3..=1e5).contains(t))
                && args.exposures_ms.windows(2).all(|t| t[0] < t[1]),
            "times in ms, each longer than the one before, as 1,4,16",
        ),
    ] {
        if !ok {
            return Err(Failure::input(format!("{name}: out of range"), hint));
        }
    }
    // A list must never stand beside frames that it does not describe, as it would if this run were interrupted.
    let list = args.out.join(MANIFEST_FILE);
    if list.exists() {
        let hint = "choose another folder for --out, or remove the captures there";
        return Err(Failure::input(format!("{}: captures are there already", list.display()), hint));
    }
    Ok(())
}

/// The sensor as the manifest names it: a file is copied beside the manifest, so that the folder stands alone.
fn sensor_name(args: &Args) -> Result<String, Failure> {
    let path = std::path::Path::new(&args.sensor);
    if !path.is_file() {
        return Ok(args.sensor.clone());
    }
    let text = std::fs::read(path).map_err(DesignError::io(path))?;
    let copy = args.out.join("sensor.toml");
    write_whole(&copy, &text).map_err(DesignError::io(&copy))?;
    Ok("sensor.toml".to_owned())
}

/// Image radii of the fields, mm.
fn radii_mm(args: &Args) -> impl Iterator<Item = f64> {
    let last = args.fields.saturating_sub(1).max(1) as f64;
    (0..args.fields).map(move |i| args.radius_mm * i as f64 / last)
}

/// The places that the sensor reaches; the axis counts once.
fn places<'a>(
    args: &Args,
    psfs: &'a [(f64, PinholePsf)],
    sensor: &SensorModel,
) -> Result<Vec<Place<'a>>, Failure> {
    let mut places = Vec::new();
    let mut axes: Vec<Axis> = Vec::new();
    args.axes.iter().for_each(|axis| {
        if !axes.contains(axis) {
            axes.push(*axis);
        }
    });
    for axis in &axes {
        let (name, azimuth_rad) = match axis {
            Axis::Vertical => ("vertical", std::f64::consts::FRAC_PI_2),
            Axis::Horizontal => ("horizontal", 0.0),
            Axis::Diagonal => ("diagonal", (sensor.height as f64).atan2(sensor.width as f64)),
        };
        for (radius, psf) in psfs {
            if *radius == 0.0 && !places.is_empty() {
                continue;
            }
            let number = places.len() as u64;
            if let Some(place) = place(args, sensor, (name, azimuth_rad), *radius, psf, number) {
                places.push(place);
            }
        }
    }
    // The field on the axis is one place for all axes.
    let on_axis = psfs.iter().filter(|(radius, _)| *radius == 0.0).count();
    let asked = axes.len() * (psfs.len() - on_axis) + on_axis.min(1);
    if (1..asked).contains(&places.len()) {
        eprintln!("{} of {asked} fields lie beyond the sensor and are left out", asked - places.len());
    }
    if places.is_empty() {
        return Err(Failure::input(
            format!("no field up to {} mm lies on the sensor", args.radius_mm),
            "a smaller --window or --radius-mm",
        ));
    }
    Ok(places)
}

/// One place; `None` if its window leaves the sensor.
fn place<'a>(
    args: &Args,
    sensor: &SensorModel,
    (name, azimuth_rad): (&str, f64),
    radius_mm: f64,
    psf: &'a PinholePsf,
    number: u64,
) -> Option<Place<'a>> {
    // The chief ray lands where distortion puts it, and alignment is off by up to half a pixel either way.
    let pixels = 1e3 * psf.chief_mm / sensor.pixel_um;
    let off = [0, 1].map(|axis| misalignment(args.seed, 2 * number + axis));
    let chief_px = [
        0.5 * (sensor.height as f64 - 1.0) + pixels * azimuth_rad.sin() + off[0],
        0.5 * (sensor.width as f64 - 1.0) + pixels * azimuth_rad.cos() + off[1],
    ];
    let half = args.window as f64 / 2.0;
    let start = |at: f64, size: usize| {
        let first = (at - half).round();
        // Towards the border of the sensor the window stays inside, as long as the PSF's crop fits.
        let most = size.checked_sub(args.window)? as f64;
        let room = CROP as f64;
        (at >= room && at <= size as f64 - room).then(|| first.clamp(0.0, most) as usize)
    };
    let placement =
        Placement { row: start(chief_px[0], sensor.height)?, col: start(chief_px[1], sensor.width)? };
    let spot = Spot {
        row: chief_px[0] - placement.row as f64,
        col: chief_px[1] - placement.col as f64,
        azimuth_rad,
    };
    Some(Place {
        name: if radius_mm == 0.0 { "axis".to_owned() } else { format!("{name}-{radius_mm:.2}") },
        field_radius_mm: radius_mm,
        azimuth_deg: azimuth_rad.to_degrees(),
        chief_px,
        psf: &psf.psf,
        spot,
        placement,
    })
}

/// An even number in -1/2..1/2 for a seed and a place (splitmix64).
fn misalignment(seed: u64, number: u64) -> f64 {
    let mut z =
        seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(number.wrapping_mul(0xd1b5_4a32_d192_ed03));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 - 0.5
}

/// How far to turn the source up until the brightest pixel reaches its share of the range at the longest exposure.
fn brightness(args: &Args, sensor: &SensorModel, places: &[Place]) -> f64 {
    let longest_s = 1e-3 * args.exposures_ms.last().copied().unwrap_or(1.0);
    let range_e = ((sensor.max_dn() - sensor.black_level_dn) / sensor.gain_dn_per_e).min(sensor.full_well_e);
    let brightest = places
        .iter()
        .map(|p| p.light(args.window, sensor.pixel_um, 1.0).brightest_e_per_s(&sensor.cfa))
        .fold(f64::MIN_POSITIVE, f64::max);
    args.peak * range_e / (longest_s * brightest)
}

/// Takes and writes all frames.
fn take_all(
    args: &Args,
    sensor: &SensorModel,
    places: &[Place],
    scale: f64,
) -> Result<Vec<Position>, Failure> {
    let per_exposure = args.frames + args.dark_frames;
    let bar = ProgressBar::new((places.len() * args.exposures_ms.len() * per_exposure) as u64);
    if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:30}] {pos}/{len} frames, {eta} left") {
        bar.set_style(style);
    }
    let noise = Noise { mode: NoiseMode::Exact, seed: args.seed };
    let mut number = 0u64;
    let mut positions = Vec::new();
    for place in places {
        bar.set_message(place.name.clone());
        Failure::folder(&args.out.join(&place.name))?;
        let day = place.light(args.window, sensor.pixel_um, scale);
        let night =
            WindowLight { rate_e_per_s: day.rate_e_per_s.each_ref().map(|p| vec![0.0; p.len()]), ..day };
        let mut exposure = Vec::new();
        for time_ms in &args.exposures_ms {
            let mut take = |light: &WindowLight, kind: &str, n: usize| -> Result<String, Failure> {
                let raw = take_frame(light, sensor, 1e-3 * time_ms, 1.0, &noise, number)
                    .map_err(DesignError::from)?;
                number += 1;
                let name = format!("{}/{time_ms}ms-{kind}{n:02}.png", place.name);
                let frame = RawFrame::from_raw(&raw, sensor);
                save_raw_alone(&frame, &args.out.join(&name), RawFormat::Png)?;
                bar.inc(1);
                Ok(name)
            };
            let frames = (0..args.frames).map(|n| take(&day, "", n)).collect::<Result<_, _>>()?;
            let dark_frames =
                (0..args.dark_frames).map(|n| take(&night, "dark-", n)).collect::<Result<_, _>>()?;
            exposure.push(ExposureFiles {
                exposure_ms: unspanned(*time_ms),
                frames: unspanned(frames),
                dark_frames,
            });
        }
        positions.push(Position {
            name: unspanned(place.name.clone()),
            field_radius_mm: Some(unspanned(place.field_radius_mm)),
            azimuth_deg: Some(unspanned(place.azimuth_deg)),
            origin: unspanned([place.placement.row, place.placement.col]),
            expected_px: Some(unspanned(place.chief_px)),
            exposure,
        });
    }
    bar.finish_and_clear();
    Ok(positions)
}
