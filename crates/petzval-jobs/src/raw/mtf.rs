//! `raw mtf`: the MTF at slanted edges of a raw frame or a picture.

use std::path::{Path, PathBuf};

use petzval_base::csv_text;
use petzval_camera::image::LinearImage;
use petzval_camera::sensor::CfaPattern;
use petzval_files::load_image;
use petzval_files::raw_file::{RawFrame, holds_digital_numbers, load_raw};
use petzval_lab::edge_mtf::{
    Channel, EdgeMtf, Missed, RegionPicture, SEARCHED_DEG, SIDE, edge_mtf, find_edges, missed_edge,
    picture_channels, raw_channels,
};
use petzval_lab::sfr::SfrError;
use petzval_report::mtf_sheet::{EdgePanel, mtf_svg};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result, json, make_folder, write_file};
use crate::event::WarningKind;
use crate::pile::{Pile, pile_below};
use crate::pixels::{check_numbers, check_picture};
use crate::range::check_ranges;
use crate::results::{check_folder, what_is};

pub use petzval_lab::edge_mtf::Region;

/// The files in the folder of results.
const FILES: [&str; 3] = ["mtf.csv", "mtf.json", "mtf.svg"];

petzval_base::parameters! {
    /// A frame to measure.
    pub struct Request {
        /// Pixel pitch in place of that of the sidecar, um.
        pixel_um: Option<f64> = None, "um", 0.1..1000.0, Log, "give the pixel pitch in um";
    }
    also {
        /// A raw frame, as `raw show` reads it, or a picture.
        file: PathBuf = PathBuf::new();
        /// Regions with one edge each; if none are given, edges are looked for.
        regions: Vec<Region> = Vec::new();
        /// Take gray integers as a picture, and undo its sRGB curve; otherwise they are digital numbers.
        is_picture: bool = false;
        /// Colour filter array in place of that of the sidecar; of raw frames only.
        cfa: Option<CfaPattern> = None;
        /// Folder for `mtf.csv`, `mtf.json` and `mtf.svg`; nothing is written without it.
        out: Option<PathBuf> = None;
    }
}

/// How the values of a file became light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Light {
    /// Digital numbers, without their black level where it is known.
    Raw,
    /// Decoded by the inverse of the sRGB curve.
    SrgbUndone,
    /// Floats, which are linear.
    Linear,
}

impl Light {
    /// What was done, in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Raw => "digital numbers above black, linear",
            Self::SrgbUndone => "picture, its sRGB curve undone",
            Self::Linear => "picture of floats, linear as it is",
        }
    }
}

/// The edges of a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The file, as it was named.
    pub file: String,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// How its values became light.
    pub light: Light,
    /// Pixel pitch, um.
    pub pixel_um: Option<f64>,
    /// The edges, in the order of the request or of the frame.
    pub edges: Vec<Edge>,
    /// The files that were written.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub files: Vec<PathBuf>,
}

/// An edge.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Edge {
    /// Where it is.
    pub region: Region,
    /// The channels that could be measured.
    pub channels: Vec<EdgeMtf>,
}

/// A frame as light.
struct Frame {
    height: usize,
    width: usize,
    channels: Vec<Channel>,
    light: Light,
    pixel_um: Option<f64>,
    /// Least and largest value that a pixel can have, where they are known: at these light may be cut off.
    ends: [Option<f64>; 2],
    /// The ends in words.
    end_names: [String; 2],
}

/// The ends in words, where they are stated.
const ENDS: [&str; 2] = ["the least value", "the white level"];

/// How a cancelled job ends.
const STOPPED: &str = "stopped before its edges were measured";

/// Share of pixels at an end from which there is a warning.
const CLIPPED_SHARE: f64 = 0.005;

/// Change of the light across a region that is said, of its level.
const SAID_FALL: f64 = 0.03;

/// Pixels in memory.
#[derive(Clone, Copy, Debug)]
pub enum Pixels<'a> {
    /// A raw frame, with its colour filters, levels and pitch as far as they are known.
    Raw(&'a RawFrame),
    /// A picture of three planes in linear light.
    Picture(&'a LinearImage),
}

/// Measures the edges of pixels in memory, in place of the file of the request; writes nothing. `name` is what the response calls them.
pub fn edges(request: &Request, name: &str, pixels: Pixels<'_>, context: &Context) -> Result<Response> {
    check_ranges(request)?;
    let frame = match pixels {
        Pixels::Raw(raw) => {
            check_numbers(raw, name)?;
            frame_of_raw(request, raw, name, context)?
        }
        Pixels::Picture(light) => {
            check_picture(light, name)?;
            frame_of_picture(request, light, true)?
        }
    };
    measured_edges(request, name, &frame, context)
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> =
    AsUnit::placed(|request, folder| request.out = request.out.take().map(|_| folder.to_owned()));

/// Reads the frame, measures its edges, and writes the files.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    check_ranges(request)?;
    if let Some(out) = &request.out {
        check_folder(out, FILES, context)?;
    }
    let frame = read(request, context)?;
    let name = request.file.display().to_string();
    let mut response = measured_edges(request, &name, &frame, context)?;
    if let Some(out) = &request.out {
        make_folder(out)?;
        response.files = FILES.iter().map(|name| out.join(name)).collect();
        let contents = [csv(&response), json(&response)?, plot(&response, &frame)];
        for (path, content) in response.files.iter().zip(contents) {
            write_file(path, content)?;
            context.wrote(path, what_is(path));
        }
    }
    Ok(response)
}

/// The edges that the request names in a frame, or those that are found.
fn measured_edges(request: &Request, name: &str, frame: &Frame, context: &Context) -> Result<Response> {
    for region in &request.regions {
        if !region.is_inside(frame.height, frame.width) {
            let message = format!("the frame has {} rows and {} columns", frame.height, frame.width);
            let hint = "give ROW,COL,HEIGHT,WIDTH, rows and columns counted from 0";
            return Err(JobError::setting("region", region, message, hint));
        }
    }
    let edges = if request.regions.is_empty() {
        found(name, frame, context)?
    } else {
        let each = request.regions.iter().map(|region| measured(region, frame, context));
        each.collect::<Result<Vec<_>, _>>()?
    };
    warn(&edges, frame, context);
    Ok(Response {
        file: name.to_owned(),
        height: frame.height,
        width: frame.width,
        light: frame.light,
        pixel_um: frame.pixel_um,
        edges,
        files: Vec::new(),
    })
}

/// Cycles per mm of a frequency in cycles per pixel.
pub fn per_mm(per_px: f64, pixel_um: f64) -> f64 {
    1e3 * per_px / pixel_um
}

/// Reads the file as light.
fn read(request: &Request, context: &Context) -> Result<Frame> {
    if !request.is_picture && holds_digital_numbers(&request.file)? {
        let name = request.file.display().to_string();
        return frame_of_raw(request, &load_raw(&request.file)?, &name, context);
    }
    check_no_mosaic(request)?;
    let picture = load_image(&request.file).map_err(petzval_design::error::DesignError::from)?;
    let name = request.file.display();
    picture.notes.iter().for_each(|note| context.warning(WarningKind::RawFrame, format!("{name}: {note}")));
    frame_of_picture(request, &picture.light, picture.is_linear)
}

/// Refuses a colour filter array of a picture.
fn check_no_mosaic(request: &Request) -> Result<()> {
    match request.cfa {
        Some(cfa) => {
            let message = "a picture has no mosaic";
            Err(JobError::setting("cfa", cfa, message, "leave it out, or give a raw frame"))
        }
        None => Ok(()),
    }
}

fn frame_of_picture(request: &Request, light: &LinearImage, is_linear: bool) -> Result<Frame> {
    check_no_mosaic(request)?;
    Ok(Frame {
        height: light.height,
        width: light.width,
        channels: picture_channels(light),
        light: if is_linear { Light::Linear } else { Light::SrgbUndone },
        pixel_um: request.pixel_um,
        // Whole numbers of a picture end at black and white; floats have no end.
        ends: if is_linear { [None; 2] } else { [Some(0.0), Some(1.0)] },
        end_names: ENDS.map(str::to_owned),
    })
}

fn frame_of_raw(request: &Request, raw: &RawFrame, name: &str, context: &Context) -> Result<Frame> {
    let cfa = request.cfa.or(raw.info.cfa).unwrap_or_else(|| {
        context.warning(WarningKind::RawFrame, format!(
            "{name}: no sidecar states its mosaic, and all pixels are taken for one colour; --cfa RGGB names one"
        ));
        CfaPattern::MONO
    });
    // An unknown black level moves the levels and leaves the response.
    let black = raw.info.black_level_dn.unwrap_or(0.0);
    let tile = raw.info.black_tile_dn.iter().flatten().copied();
    let (least_black, most_black) =
        tile.fold((black, black), |(least, most), level| (least.min(level), most.max(level)));
    let black_at = |i: usize| raw.info.black_at_dn(i / raw.width, i % raw.width).unwrap_or(0.0);
    let values: Vec<f32> =
        raw.dn.iter().enumerate().map(|(i, dn)| (f64::from(*dn) - black_at(i)) as f32).collect();
    let channels = raw_channels(&values, raw.width, cfa).ok_or_else(|| {
        JobError::input(
            format!("{name}: the mosaic {cfa} is not measured: its colours do not repeat after 1 or 2 pixels in rows and columns"),
            instead_of(cfa),
        )
    })?;
    let converter = raw.info.bits.map(|bits| 2f64.powi(bits as i32) - 1.0);
    let white = match (raw.info.white_level_dn, converter) {
        (Some(white), Some(converter)) => Some(white.min(converter)),
        (white, converter) => white.or(converter),
    };
    let pile = pile_of(raw, cfa, white);
    let white_name = pile
        .map_or_else(|| ENDS[1].to_owned(), |pile| format!("the largest numbers, from {} DN on", pile.dn));
    let white = pile.map(|pile| f64::from(pile.dn)).or(white);
    Ok(Frame {
        height: raw.height,
        width: raw.width,
        channels,
        light: Light::Raw,
        pixel_um: request.pixel_um.or(raw.info.pixel_um),
        // Light that is cut off has one number before the black levels of the tile are subtracted.
        ends: [Some(-least_black), white.map(|white| white - most_black)],
        end_names: [ENDS[0].to_owned(), white_name],
    })
}

/// The pixels that pile up below the white level, DN, as `isp develop` finds them: it is unknown or wrong.
fn pile_of(raw: &RawFrame, cfa: CfaPattern, white_dn: Option<f64>) -> Option<Pile> {
    if raw.info.companding.is_some() {
        return None;
    }
    let dn: Vec<u32> = raw.dn.iter().map(|dn| u32::from(*dn)).collect();
    pile_below(&dn, raw.width, cfa, white_dn.unwrap_or(f64::INFINITY))
}

/// The frame to make and measure in place of one whose colours repeat after more than 2 pixels.
fn instead_of(cfa: CfaPattern) -> String {
    if let Some((side, binned)) = binned(cfa) {
        return format!(
            "average each {side} x {side} pixels of one colour into one pixel, state cfa = \"{binned}\" in the sidecar of that frame, and measure it"
        );
    }
    format!(
        "write one pixel of each tile of {} x {} to a frame of its own, state cfa = \"mono\" in its sidecar, and measure it",
        cfa.rows(),
        cfa.cols()
    )
}

/// The Bayer array of squares of one colour, such as those of a quad-Bayer array, and the side of a square, pixels. `None` for other arrays.
fn binned(cfa: CfaPattern) -> Option<(usize, CfaPattern)> {
    let side = cfa.rows() / 2;
    if cfa.rows() != cfa.cols() || cfa.rows() != 2 * side {
        return None;
    }
    let letters =
        [[0, 0], [0, side], [side, 0], [side, side]].map(|[row, col]| cfa.colour(row, col).letter());
    let bayer: CfaPattern = letters.iter().collect::<String>().parse().ok()?;
    let mut places = (0..cfa.rows()).flat_map(|row| (0..cfa.cols()).map(move |col| (row, col)));
    let is_binned = places.all(|(row, col)| cfa.colour(row, col) == bayer.colour(row / side, col / side));
    (bayer.is_bayer() && is_binned).then_some((side, bayer))
}

/// The edge in a region that the request names. A channel without a response is warned of; a region without any is refused.
fn measured(region: &Region, frame: &Frame, context: &Context) -> Result<Edge> {
    let (mut channels, mut failures) = (Vec::new(), Vec::new());
    for channel in &frame.channels {
        context.check(|| STOPPED)?;
        match edge_mtf(channel, region) {
            Ok(mtf) => channels.push(mtf),
            Err(error) => failures.push(format!("{}: {error}", channel.name)),
        }
    }
    if channels.is_empty() {
        let pitch = frame.channels.first().map_or(1, |channel| channel.pitch);
        let mosaic = if pitch > 1 { " (every second pixel belongs to a colour)" } else { "" };
        let hint = format!(
            "name a region that one straight edge crosses, about 5 degrees off the rows or columns{mosaic}"
        );
        return Err(JobError::setting("region", region, failures.join("; "), hint));
    }
    failures
        .iter()
        .for_each(|failure| context.warning(WarningKind::Edge, format!("region {region}: {failure}")));
    Ok(Edge { region: *region, channels })
}

/// The edges that are found in the channel with the most light: green, or the first. A channel in which one of them has no response is left out there.
fn found(name: &str, frame: &Frame, context: &Context) -> Result<Vec<Edge>> {
    let green = frame.channels.iter().find(|channel| channel.pitch > 1 && channel.name == "green");
    let channel = green.or(frame.channels.first());
    let searched = channel.map(|channel| find_edges(channel, context.cancel())).transpose();
    let searched = searched.map_err(|_| context.stopped(STOPPED))?.unwrap_or_default();
    let mut edges = Vec::new();
    for region in searched {
        let mut channels = Vec::new();
        for channel in &frame.channels {
            context.check(|| STOPPED)?;
            channels.extend(edge_mtf(channel, &region).ok());
        }
        if !channels.is_empty() {
            edges.push(Edge { region, channels });
        }
    }
    if edges.is_empty() { Err(none_found(name, channel, context)) } else { Ok(edges) }
}

/// Why no edge was found in a channel.
fn none_found(name: &str, channel: Option<&Channel>, context: &Context) -> JobError {
    let (least, largest) = SEARCHED_DEG.into_inner();
    let missed = channel.map(|channel| missed_edge(channel, context.cancel())).transpose();
    let Ok(missed) = missed else { return context.stopped(STOPPED).into() };
    match missed.flatten() {
        Some(Missed::Angle { region, deg }) => JobError::input(
            format!(
                "{name}: no slanted edge was found: they are searched from {least:.0} to {largest:.0} degrees off the rows or columns, and the \
                 one in region {region} is at {deg:.1} degrees"
            ),
            format!("measure it with --region {region}, or with a larger region about it"),
        ),
        Some(Missed::NoResponse { region, error }) => {
            let hint = match error {
                SfrError::Clipped { .. } => {
                    "expose so that neither side of the edge reaches an end of the range; --region ROW,COL,HEIGHT,WIDTH names another edge"
                }
                _ => {
                    "name another edge with --region ROW,COL,HEIGHT,WIDTH, about 5 degrees off the rows or columns"
                }
            };
            JobError::input(
                format!("{name}: no slanted edge was found that can be measured; region {region}: {error}"),
                hint,
            )
        }
        None => {
            let pitch = channel.map_or(1, |channel| channel.pitch);
            let side = pitch * SIDE;
            JobError::input(
                format!(
                    "{name}: no slanted edge was found in windows of {side}x{side} pixels, from {least:.0} to {largest:.0} degrees off the rows \
                     or columns"
                ),
                "name one with --region ROW,COL,HEIGHT,WIDTH: a straight edge, about 5 degrees off the rows or columns, that crosses the region",
            )
        }
    }
}

/// Warns of effects on the figures of an edge: clipped pixels, rounding, light that was divided out, and pixels that were left out.
fn warn(edges: &[Edge], frame: &Frame, context: &Context) {
    for edge in edges {
        for mtf in &edge.channels {
            let of = format!("region {}: {}", edge.region, mtf.channel);
            if let Some(channel) = frame.channels.iter().find(|channel| channel.name == mtf.channel) {
                // Pixels that are left out, such as dead ones, do not change the response.
                let places = channel.planes.len() as f64 / (channel.pitch * channel.pitch) as f64;
                let pixels = (edge.region.height * edge.region.width) as f64 * places;
                let left_out = mtf.left_out as f64 / pixels;
                for (share, end) in
                    channel.shares_at(&edge.region, frame.ends).into_iter().zip(&frame.end_names)
                {
                    if share - left_out > CLIPPED_SHARE {
                        context.warning(WarningKind::Edge, format!(
                            "{of}: {:.1} % of the pixels are at {end}: if light was cut off there, the response is wrong",
                            100.0 * share
                        ));
                    }
                }
            }
            if let Some(limit) = mtf.undetermined_above_per_px() {
                context.warning(WarningKind::Edge, format!(
                    "{of}: at {:.1} degrees the pixels sample the edge only every {:.2} pixels, so the response above {limit:.2} cycles per pixel is \
                     not determined; incline the edge by about 5 degrees",
                    mtf.angle_deg, mtf.gap_px
                ));
            }
            if let Some(step) = mtf.coarse_step {
                context.warning(WarningKind::Edge, format!(
                    "{of}: a side has less noise than a step of its values, {:.1} % of the edge: rounding may move the response by as much, \
                     beyond the standard errors; give more bits, or a frame with its noise",
                    100.0 * step
                ));
            }
            if let Some(fall) = mtf.light_fall.filter(|fall| *fall > SAID_FALL) {
                context.note(format!(
                    "{of}: the light changes by {:.0} % of its level across the region; this is divided out",
                    100.0 * fall
                ));
            }
            if mtf.left_out > 0 {
                context.warning(
                    WarningKind::Edge,
                    match mtf.left_out {
                        1 => format!("{of}: 1 pixel that does not fit the profile is left out"),
                        count => format!("{of}: {count} pixels that do not fit the profile are left out"),
                    },
                );
            }
        }
    }
}

/// The curves, a line for every frequency of every channel of every edge.
fn csv(response: &Response) -> String {
    let place = ["row_px", "col_px", "height_px", "width_px", "channel", "frequency_cycles_per_px"];
    let on_sensor = response.pixel_um.map(|_| "frequency_cycles_per_mm");
    let head = place.into_iter().chain(on_sensor).chain(["modulation", "standard_error"]);
    let mut lines: Vec<Vec<String>> = vec![head.map(str::to_owned).collect()];
    for Edge { region, channels } in &response.edges {
        for mtf in channels {
            let values = mtf.modulation.iter().zip(&mtf.standard_errors.modulation);
            for (frequency, (modulation, error)) in mtf.frequency_per_px.iter().zip(values) {
                let on_sensor = response.pixel_um.map(|um| per_mm(*frequency, um));
                let numbers = [*frequency].into_iter().chain(on_sensor).chain([*modulation, *error]);
                let Region { row, col, height, width } = region;
                let place = [row, col, height, width]
                    .map(|px| px.to_string())
                    .into_iter()
                    .chain([mtf.channel.clone()]);
                lines.push(place.chain(numbers.map(|number| number.to_string())).collect());
            }
        }
    }
    csv_text(lines)
}

fn plot(response: &Response, frame: &Frame) -> String {
    let panels: Vec<EdgePanel> = response.edges.iter().map(|edge| panel(edge, frame)).collect();
    let name =
        Path::new(&response.file).file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    mtf_svg(&format!("{name}: {}", response.light.words()), &panels)
}

/// An edge as the sheet shows it.
fn panel<'a>(edge: &'a Edge, frame: &Frame) -> EdgePanel<'a> {
    let first = edge.channels.first();
    let channel = frame.channels.iter().find(|channel| first.is_some_and(|mtf| mtf.channel == channel.name));
    EdgePanel {
        region: edge.region,
        channels: edge.channels.iter().collect(),
        picture: channel.and_then(|channel| RegionPicture::of(channel, &edge.region)),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use petzval_files::raw_file::RawInfo;

    use super::*;
    use crate::event::Lines;

    const SIDE: usize = 90;

    /// A frame with an edge at 7 degrees from 3000 to 40,000 DN and noise of 400 DN, whose light is cut off at a number.
    fn edge(cut_dn: f64, white_level_dn: Option<f64>) -> RawFrame {
        let mut state = 3_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut normal = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let (sin, cos) = 7_f64.to_radians().sin_cos();
        let mut dn = |i: usize| {
            let distance = ((i % SIDE) as f64 - 44.5) * cos + ((i / SIDE) as f64 - 44.5) * sin;
            let light = 3000.0 + 37_000.0 / (1.0 + (-distance / 0.4).exp());
            (light + 400.0 * normal()).min(cut_dn).round() as u16
        };
        let info = RawInfo {
            bits: Some(16),
            cfa: Some(CfaPattern::MONO),
            black_level_dn: Some(200.0),
            white_level_dn,
            ..RawInfo::default()
        };
        RawFrame { height: SIDE, width: SIDE, dn: (0..SIDE * SIDE).map(&mut dn).collect(), info }
    }

    /// What is said of a frame.
    fn said(frame: &RawFrame) -> String {
        let lines = Arc::new(Lines::default());
        let context = Context::new(crate::built_in_assets(), lines.clone());
        let region = Region { row: 0, col: 0, height: SIDE, width: SIDE };
        let request = Request { regions: vec![region], ..Request::default() };
        edges(&request, "edge", Pixels::Raw(frame), &context).unwrap();
        lines.0.lock().unwrap().join("\n")
    }

    #[test]
    fn a_cancelled_search_ends_as_stopped_with_and_without_regions() {
        let context = Context::new(crate::built_in_assets(), Arc::new(Lines::default()));
        context.cancel().set();
        let frame = edge(65_535.0, None);
        for regions in [vec![], vec![Region { row: 0, col: 0, height: SIDE, width: SIDE }]] {
            let request = Request { regions, ..Request::default() };
            let outcome = edges(&request, "edge", Pixels::Raw(&frame), &context);
            assert!(matches!(outcome, Err(JobError::Stopped(_))), "{outcome:?}");
        }
        let flat = RawFrame { dn: vec![500; SIDE * SIDE], ..frame };
        let outcome = edges(&Request::default(), "flat", Pixels::Raw(&flat), &context);
        assert!(matches!(outcome, Err(JobError::Stopped(_))), "{outcome:?}");
    }

    #[test]
    fn light_that_is_cut_off_below_the_white_level_is_said() {
        assert_eq!(said(&edge(65_535.0, None)), "");
        let stated = said(&edge(40_200.0, Some(40_200.0)));
        assert!(stated.contains("% of the pixels are at the white level"), "{stated}");
        for white_level_dn in [None, Some(60_000.0)] {
            let found = said(&edge(40_200.0, white_level_dn));
            let wanted = "% of the pixels are at the largest numbers, from 40200 DN on: if light was cut off";
            assert!(found.contains(wanted), "{white_level_dn:?}: {found}");
        }
    }
}
