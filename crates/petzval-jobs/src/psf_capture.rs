//! `psf-capture`: simulated captures of a pinhole, as a laboratory would take them.

use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

use petzval_camera::render::Placement;
use petzval_camera::sensor::{Noise, NoiseMode, SensorModel};
use petzval_design::error::DesignError;
use petzval_files::raw_file::{RawFormat, RawFrame, save_raw_alone};
use petzval_lab::psf_calibration::capture::{WindowLight, take_frame};
use petzval_lab::psf_calibration::manifest::{
    ExposureFiles, MANIFEST_FILE, Manifest, Position, Source, unspanned,
};
use petzval_lab::psf_calibration::measure::check_mosaic;
use petzval_lab::psf_calibration::{CROP, FinePsf, Spot};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result, make_folder, write_file};
use crate::frames::Frames;
use crate::input::{Input, LensInput, SensorInput};
use crate::pinhole::{PinholePsf, PinholeView, Refocus};
use crate::range::check_ranges;
use crate::state_file::{CAPTURES, lock_folder};

petzval_base::parameters! {
    /// Captures of a pinhole: frames and their manifest, for [`crate::psf_calibrate`].
    ///
    /// A pinhole lit by a white diode of 4900 K is put at field radii along directions from the axis; fields that the sensor does
    /// not reach are left out. The camera turns towards the source. At each place frames are taken at several exposure times
    /// with the sensor's noise; only a window around the source is written. A folder that holds captures is not changed.
    pub struct Request {
        /// Distance of the pinhole from the lens, mm, 10 to 1e7.
        distance_mm: f64 = 1500.0, "mm", 10..1e7, Log, "10 mm to 10 km; the paper has 1500";
        /// Diameter of the pinhole, um; its image may be at most a pixel wide.
        pinhole_um: f64 = 75.0, "um", 0..1e4, Linear, "a diameter in um; 0 for a point";
        /// Number of fields from the axis to `radius_mm`, 1 to 99.
        fields: usize = 9, "", 1..99, Linear, "1 to 99 fields";
        /// Image radius of the last field, mm.
        radius_mm: f64 = 6.4, "mm", 1e-6..1e3, Log, "an image radius in mm";
        /// Exposure times, ms, the shortest first.
        exposures_ms: Vec<f64> = vec![1.0, 4.0, 16.0], "ms", 1e-3..1e5, Log, "times in ms, each longer than the one before, as 1,4,16";
        /// Frames of each exposure time, 1 to 1000.
        frames: usize = 20, "", 1..1000, Linear, "1 to 1000 frames";
        /// Dark frames of each exposure time and place, 0 to 1000.
        dark_frames: usize = 0, "", 0..1000, Linear, "0 to 1000 frames";
        /// Signal of the brightest pixel of all places, behind its own colour filter, at the longest exposure, as a share of the
        /// range of converter or full well, the lesser; above 1 it clips. It sets the brightness of the source.
        peak: f64 = 0.8, "", 0.001..1000.0, Log, "0.8 uses the range well and does not clip";
        /// Pixels a side of the window that is written, 48 to 1024.
        window: usize = 64, "", 48..1024, Log, "48 to 1024 pixels";
    }
    also {
        /// Lens: a built-in name, the path of a file, or the lens itself.
        lens: LensInput = LensInput::default();
        /// Folder for the captures.
        out: PathBuf = PathBuf::new();
        /// Sensor: a built-in name, the path of a file, or the sensor itself.
        sensor: SensorInput = "imx249-calibrated".into();
        /// Where the lens is focused.
        focus: Focus = Focus::Source;
        /// Directions in which the source is moved.
        axes: Vec<Axis> = vec![Axis::Vertical, Axis::Horizontal, Axis::Diagonal];
        /// Seed of the noise and of the error of alignment, up to half a pixel.
        seed: u64 = crate::usual::seed();
    }
}

/// Where the lens is focused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Focus {
    /// On the source: the sensor moves as far as the paraxial image.
    Source,
    /// Where the lens file has it, for most lenses at infinity: a near source is then out of focus.
    File,
}

/// A direction from the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// Along the columns of the sensor, downwards.
    Vertical,
    /// Along its rows, to the right.
    Horizontal,
    /// To its corner.
    Diagonal,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Frames at all places.
    pub frames: usize,
    /// Where the manifest is, and where the source was.
    pub captures: Captures,
}

/// Captures of a pinhole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Captures {
    /// The list of the captures.
    pub manifest: String,
    /// Shift of the image plane from its place in the lens file, mm.
    pub refocus_mm: f64,
    /// Paraxial image height over the tangent of the field angle, mm.
    pub image_scale_mm: f64,
    /// Diameter of the pinhole's image, um.
    pub pinhole_image_um: f64,
    /// Places of the source.
    pub positions: Vec<CapturedPosition>,
}

/// A place of the source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CapturedPosition {
    /// Its name, which is also that of its folder.
    pub name: String,
    /// Ideal image radius, mm.
    pub field_radius_mm: f64,
    /// Direction from the axis, degrees from the columns towards higher rows.
    pub azimuth_deg: f64,
    /// Where the chief ray lands on the sensor, (row, column), px.
    pub chief_ray_px: [f64; 2],
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> = AsUnit {
    out_in: Some(""),
    ..AsUnit::seeded(|request, seed| request.seed = seed, |request, folder| request.out = folder.to_owned())
};

/// Traces the PSFs, exposes all frames, and writes them with their manifest.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    request.check()?;
    let (lens_name, context) = &request.lens.placed(context)?;
    let (name_of_sensor, context) = &request.sensor.placed(context)?;
    let lens = context.assets.lens(lens_name)?.lens;
    let sensor = context.assets.sensor(name_of_sensor)?;
    check_mosaic(sensor.cfa)?;
    let refocus = match request.focus {
        Focus::Source => Refocus::OnSource,
        Focus::File => Refocus::Mm(0.0),
    };
    let view =
        PinholeView::new(&lens, &sensor, Some(request.distance_mm), request.pinhole_um, true, refocus)?;
    let psfs = request.radii_mm().map(|radius_mm| {
        context.check(|| "stopped before any frame was taken")?;
        Ok((radius_mm, view.psf(radius_mm)?))
    });
    let psfs: Vec<(f64, PinholePsf)> = psfs.collect::<Result<_>>()?;
    let places = places(request, &psfs, &sensor, context)?;
    let scale = brightness(request, &sensor, &places);

    make_folder(&request.out)?;
    let _lock = lock_folder(&request.out, CAPTURES)?;
    // Another process may have worked here since the first look.
    request.check_new()?;
    let manifest = Manifest {
        sensor: sensor_name(request)?,
        linear_gain: unspanned(1.0),
        source: Source {
            distance_mm: Some(unspanned(request.distance_mm)),
            pinhole_um: request.pinhole_um,
            camera_turned: true,
            image_scale_mm: Some(unspanned(view.image_scale_mm)),
            refocus_mm: Some(unspanned(view.refocus_mm)),
        },
        position: take_all(request, &sensor, &places, scale, context)?,
    };
    let path = request.out.join(MANIFEST_FILE);
    let text = manifest.to_toml().map_err(|e| JobError::failed(format!("{}: {e}", path.display())))?;
    let head = format!("# Simulated: {} through {}.\n", sensor.name, lens.name);
    write_file(&path, format!("{head}{text}"))?;
    context.wrote(&path, "list of captures");
    Ok(Response {
        frames: places.len() * request.frames_of_a_place(),
        captures: Captures {
            manifest: path.display().to_string(),
            refocus_mm: view.refocus_mm,
            image_scale_mm: view.image_scale_mm,
            pinhole_image_um: view.disc_um,
            positions: places.iter().map(CapturedPosition::from).collect(),
        },
    })
}

impl Request {
    /// Checks that every setting is in its range, and that the folder holds no captures.
    fn check(&self) -> Result<()> {
        check_ranges(self)?;
        let is_ascending =
            !self.exposures_ms.is_empty() && self.exposures_ms.windows(2).all(|ms| ms[0] < ms[1]);
        for (key, is_in_range, hint) in [
            (
                "fields",
                self.radius_mm / self.fields as f64 >= 0.01,
                "so few that they lie 0.01 mm apart or more",
            ),
            ("axes", !self.axes.is_empty(), "one or more of vertical, horizontal and diagonal"),
            ("exposures_ms", is_ascending, "times in ms, each longer than the one before, as 1,4,16"),
        ] {
            if !is_in_range {
                return Err(JobError::setting(key, "", "out of range", hint));
            }
        }
        self.check_new()
    }

    /// A manifest must never stand beside frames that it does not describe, as it would if this run were interrupted.
    fn check_new(&self) -> Result<()> {
        let manifest = self.out.join(MANIFEST_FILE);
        if manifest.exists() {
            let hint = "choose another folder for --out, or remove the captures there";
            return Err(JobError::input(format!("{}: captures are there already", manifest.display()), hint));
        }
        Ok(())
    }

    /// Image radii of the fields, mm.
    fn radii_mm(&self) -> impl Iterator<Item = f64> {
        let last = self.fields.saturating_sub(1).max(1) as f64;
        (0..self.fields).map(move |i| self.radius_mm * i as f64 / last)
    }

    /// Frames of one place, at all exposure times.
    fn frames_of_a_place(&self) -> usize {
        self.exposures_ms.len() * (self.frames + self.dark_frames)
    }
}

/// The name of the sensor in the manifest. A sensor that is not built in is copied beside the manifest, so that the folder is complete.
fn sensor_name(request: &Request) -> Result<String> {
    let text = match &request.sensor {
        Input::Name(name) if !Path::new(name).is_file() => return Ok(name.clone()),
        Input::Name(path) => {
            petzval_base::read_whole(Path::new(path)).map_err(DesignError::io(Path::new(path)))?
        }
        Input::Inline(sensor) => sensor.toml.clone().into_bytes(),
    };
    let copy = request.out.join("sensor.toml");
    write_file(&copy, &text)?;
    Ok("sensor.toml".to_owned())
}

/// A place of the source, with its PSF. The window's light is computed when it is used, because the windows of many places
/// together fill the memory.
struct Place<'a> {
    name: String,
    field_radius_mm: f64,
    azimuth_deg: f64,
    chief_ray_px: [f64; 2],
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

impl From<&Place<'_>> for CapturedPosition {
    fn from(place: &Place) -> Self {
        Self {
            name: place.name.clone(),
            field_radius_mm: place.field_radius_mm,
            azimuth_deg: place.azimuth_deg,
            chief_ray_px: place.chief_ray_px,
        }
    }
}

/// The places that the sensor reaches. The field on the axis is one place for all directions.
fn places<'a>(
    request: &Request,
    psfs: &'a [(f64, PinholePsf)],
    sensor: &SensorModel,
    context: &Context,
) -> Result<Vec<Place<'a>>> {
    let mut axes: Vec<Axis> = Vec::new();
    for axis in &request.axes {
        if !axes.contains(axis) {
            axes.push(*axis);
        }
    }
    let mut places = Vec::new();
    for axis in &axes {
        let (name, azimuth_rad) = match axis {
            Axis::Vertical => ("vertical", FRAC_PI_2),
            Axis::Horizontal => ("horizontal", 0.0),
            Axis::Diagonal => ("diagonal", (sensor.height as f64).atan2(sensor.width as f64)),
        };
        for (radius_mm, psf) in psfs {
            if *radius_mm == 0.0 && !places.is_empty() {
                continue;
            }
            let number = places.len() as u64;
            places.extend(place(request, sensor, (name, azimuth_rad), *radius_mm, psf, number));
        }
    }
    let on_axis = psfs.iter().filter(|(radius_mm, _)| *radius_mm == 0.0).count();
    let all = axes.len() * (psfs.len() - on_axis) + on_axis.min(1);
    if places.is_empty() {
        return Err(JobError::input(
            format!("no field up to {} mm lies on the sensor", request.radius_mm),
            "a smaller --window or --radius-mm",
        ));
    }
    if places.len() < all {
        context
            .note(format!("{} of {all} fields lie beyond the sensor and are left out", all - places.len()));
    }
    Ok(places)
}

/// One place; `None` if its window leaves the sensor.
fn place<'a>(
    request: &Request,
    sensor: &SensorModel,
    (name, azimuth_rad): (&str, f64),
    radius_mm: f64,
    psf: &'a PinholePsf,
    number: u64,
) -> Option<Place<'a>> {
    // The chief ray lands where distortion puts it, and the alignment is off by up to half a pixel either way.
    let pixels = 1e3 * psf.chief_mm / sensor.pixel_um;
    let off = [0, 1].map(|axis| misalignment(request.seed, 2 * number + axis));
    let chief_ray_px = [
        0.5 * (sensor.height as f64 - 1.0) + pixels * azimuth_rad.sin() + off[0],
        0.5 * (sensor.width as f64 - 1.0) + pixels * azimuth_rad.cos() + off[1],
    ];
    let half = request.window as f64 / 2.0;
    let start = |at: f64, size: usize| {
        let first = (at - half).round();
        // Towards the border of the sensor the window stays inside, as long as the PSF's crop fits.
        let most = size.checked_sub(request.window)? as f64;
        let room = CROP as f64;
        (at >= room && at <= size as f64 - room).then(|| first.clamp(0.0, most) as usize)
    };
    let placement =
        Placement { row: start(chief_ray_px[0], sensor.height)?, col: start(chief_ray_px[1], sensor.width)? };
    let spot = Spot {
        row: chief_ray_px[0] - placement.row as f64,
        col: chief_ray_px[1] - placement.col as f64,
        azimuth_rad,
    };
    Some(Place {
        name: if radius_mm == 0.0 { "axis".to_owned() } else { format!("{name}-{radius_mm:.2}") },
        field_radius_mm: radius_mm,
        azimuth_deg: azimuth_rad.to_degrees(),
        chief_ray_px,
        psf: &psf.psf,
        spot,
        placement,
    })
}

/// A number that is uniform in -1/2..1/2 over seeds and places (splitmix64).
fn misalignment(seed: u64, number: u64) -> f64 {
    let mut z =
        seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(number.wrapping_mul(0xd1b5_4a32_d192_ed03));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 - 0.5
}

/// The factor that brings the brightest pixel of all places to its share of the range at the longest exposure.
fn brightness(request: &Request, sensor: &SensorModel, places: &[Place]) -> f64 {
    let longest_s = 1e-3 * request.exposures_ms.last().copied().unwrap_or(1.0);
    let range_e = ((sensor.max_dn() - sensor.black_level_dn) / sensor.gain_dn_per_e).min(sensor.full_well_e);
    let brightest = places
        .iter()
        .map(|p| p.light(request.window, sensor.pixel_um, 1.0).brightest_e_per_s(&sensor.cfa))
        .fold(f64::MIN_POSITIVE, f64::max);
    request.peak * range_e / (longest_s * brightest)
}

/// Takes and writes all frames, place by place.
fn take_all(
    request: &Request,
    sensor: &SensorModel,
    places: &[Place],
    scale: f64,
    context: &Context,
) -> Result<Vec<Position>> {
    let progress = Frames::new(context, places.len() * request.frames_of_a_place());
    let noise = Noise { mode: NoiseMode::Exact, seed: request.seed };
    let mut number = 0u64;
    let mut positions = Vec::new();
    for place in places {
        make_folder(&request.out.join(&place.name))?;
        let day = place.light(request.window, sensor.pixel_um, scale);
        let night =
            WindowLight { rate_e_per_s: day.rate_e_per_s.each_ref().map(|p| vec![0.0; p.len()]), ..day };
        let mut exposure = Vec::new();
        for time_ms in &request.exposures_ms {
            let mut take = |light: &WindowLight, kind: &str, n: usize| -> Result<String> {
                let raw = take_frame(light, sensor, 1e-3 * time_ms, 1.0, &noise, number)
                    .map_err(DesignError::from)?;
                number += 1;
                let name = format!("{}/{time_ms}ms-{kind}{n:02}.png", place.name);
                let frame = RawFrame::from_raw(&raw, sensor);
                let path = request.out.join(&name);
                save_raw_alone(&frame, &path, RawFormat::Png)?;
                context.wrote(path, "raw frame");
                progress.add(&place.name)?;
                Ok(name)
            };
            let frames = (0..request.frames).map(|n| take(&day, "", n)).collect::<Result<_, _>>()?;
            let dark_frames =
                (0..request.dark_frames).map(|n| take(&night, "dark-", n)).collect::<Result<_, _>>()?;
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
            expected_px: Some(unspanned(place.chief_ray_px)),
            exposure,
        });
    }
    Ok(positions)
}
