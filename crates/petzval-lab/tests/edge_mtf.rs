//! Edges whose response and place are known.

use std::f64::consts::PI;

use petzval_base::{Cancel, Cancelled};
use petzval_camera::image::LinearImage;
use petzval_camera::sensor::CfaPattern;

use petzval_lab::edge_mtf::{
    Channel, Missed, Region, edge_mtf, find_edges, missed_edge, picture_channels, raw_channels,
};
use petzval_lab::sfr::{SfrError, Side};

/// Inclination of the edges, degrees.
const ANGLE_DEG: f64 = 5.0;

/// Standard deviation of their blur, pixels.
const SIGMA: f64 = 0.9;

/// Light from 0.2 to 0.8 across an upright edge through a column of row 0, blurred by a Gaussian and sampled at points.
fn light(row: usize, col: usize, at_col: f64) -> f32 {
    let (sin, cos) = ANGLE_DEG.to_radians().sin_cos();
    let distance = (col as f64 + 0.5 - at_col) * cos - (row as f64 + 0.5) * sin;
    (0.2 + 0.6 * 0.5 * libm::erfc(-distance / (SIGMA * 2f64.sqrt()))) as f32
}

fn gaussian(frequency: f64) -> f64 {
    (-2.0 * (PI * SIGMA * frequency).powi(2)).exp()
}

/// The edges that are found in a channel.
fn found_in(channel: &Channel) -> Vec<Region> {
    find_edges(channel, &Cancel::default()).unwrap()
}

/// Why an edge is missed in a channel.
fn missed_in(channel: &Channel) -> Option<Missed> {
    missed_edge(channel, &Cancel::default()).unwrap()
}

#[test]
fn the_planes_of_a_mosaic_have_the_response_in_cycles_per_pixel_of_the_frame() {
    const SIDE: usize = 160;
    // Each colour sees the edge with a brightness of its own.
    let cfa = CfaPattern::GRBG;
    let seen = |row: usize, col: usize| {
        let share = [0.5, 1.0, 0.3, 1.0][cfa.colour(row, col) as usize];
        share * light(row, col, 70.0)
    };
    let values: Vec<f32> = (0..SIDE * SIDE).map(|i| seen(i / SIDE, i % SIDE)).collect();
    let channels = raw_channels(&values, SIDE, cfa).unwrap();
    let names: Vec<_> = channels.iter().map(|c| (c.name.as_str(), c.planes.len(), c.pitch)).collect();
    assert_eq!(names, [("red", 1, 2), ("green", 2, 2), ("blue", 1, 2)]);
    for (channel, share) in channels.iter().zip([0.5, 1.0, 0.3]) {
        let found = edge_mtf(channel, &Region { row: 9, col: 15, height: 140, width: 130 }).unwrap();
        assert!(found.is_upright && (found.angle_deg - ANGLE_DEG).abs() < 0.05, "{}", found.angle_deg);
        assert_eq!(found.frequency_per_px.last(), Some(&0.5));
        for (frequency, modulation) in found.frequency_per_px.iter().zip(&found.modulation) {
            // The rows of the edge fill the quarters of a pixel of a plane unevenly, which counts at its highest frequencies.
            assert!((modulation - gaussian(*frequency)).abs() < 0.015, "{frequency}: {modulation}");
        }
        let mtf50 = (2f64.ln() / 2.0).sqrt() / (PI * SIGMA);
        assert!((found.mtf50_per_px.unwrap() / mtf50 - 1.0).abs() < 0.01);
        assert!((found.mtf_at_half_nyquist - gaussian(0.25)).abs() < 0.01);
        assert!((found.levels[1] - 0.8 * share).abs() < 2e-3, "{:?}", found.levels);
    }
    let quad: CfaPattern = "RRGG/RRGG/GGBB/GGBB".parse().unwrap();
    assert_eq!(raw_channels(&values, SIDE, quad), None);
}

#[test]
fn edges_are_found_where_they_are() {
    const SIDE: usize = 240;
    // A bright bar with two slanted sides on the left, a smooth ramp and an upright edge without inclination on the right.
    let value = |row: usize, col: usize| match col {
        0..150 => light(row, col, 30.0) + 0.2 - light(row, col, 90.0) + 0.2,
        150..200 => 0.4 + 0.01 * (col as f32 - 150.0),
        _ => {
            if col < 225 {
                0.9
            } else {
                0.2
            }
        }
    };
    let values: Vec<f32> = (0..SIDE * SIDE).map(|i| value(i / SIDE, i % SIDE)).collect();
    let picture = LinearImage { channels: 3, height: SIDE, width: SIDE, data: values.repeat(3) };
    let channels = picture_channels(&picture);
    assert_eq!(channels.len(), 1, "equal planes are one channel");
    let found = found_in(&channels[0]);
    // Three windows and more fit one above the other on either side of the bar.
    assert!(found.len() >= 6, "{found:?}");
    for region in &found {
        let (top, bottom) = (region.row as f64, (region.row + region.height) as f64);
        let crosses = |at: f64| {
            let edge = |row: f64| at + row * ANGLE_DEG.to_radians().tan();
            edge(top) > region.col as f64 && edge(bottom) < (region.col + region.width) as f64
        };
        assert!(crosses(30.0) ^ crosses(90.0), "{region:?}");
        let mtf = edge_mtf(&channels[0], region).unwrap();
        assert!((mtf.mtf_at_half_nyquist - gaussian(0.25)).abs() < 0.015, "{region:?}");
    }
}

/// Side of the frames of one edge.
const ALONE: usize = 120;

/// A frame of one edge through its middle, so many degrees off the columns; light above `most` is cut off.
fn alone(deg: f64, most: f32) -> Channel {
    let (sin, cos) = deg.to_radians().sin_cos();
    let middle = 0.5 * ALONE as f64;
    let value = |i: usize| {
        let (x, y) = ((i % ALONE) as f64 + 0.5 - middle - 0.3, (i / ALONE) as f64 + 0.5 - middle);
        let share = 0.5 * libm::erfc(-(x * cos - y * sin) / (SIGMA * 2f64.sqrt()));
        ((0.2 + 0.6 * share) as f32).min(most)
    };
    let values: Vec<f32> = (0..ALONE * ALONE).map(value).collect();
    raw_channels(&values, ALONE, CfaPattern::MONO).unwrap().remove(0)
}

#[test]
fn an_edge_that_is_not_found_has_its_reason() {
    for deg in [1.0, 2.0, 30.0, 45.0] {
        let channel = alone(deg, 1.0);
        assert_eq!(found_in(&channel), [], "{deg}");
        let Some(Missed::Angle { region, deg: found }) = missed_in(&channel) else {
            panic!("{deg}: {:?}", missed_in(&channel))
        };
        assert!((found - deg).abs() < 0.1, "{deg}: {found}");
        // The region that is named can be measured.
        let mtf = edge_mtf(&channel, &region).unwrap();
        assert!((mtf.mtf_at_half_nyquist - gaussian(0.25)).abs() < 0.02, "{deg}: {region}");
    }
    let clipped = alone(5.0, 0.67);
    assert_eq!(found_in(&clipped), []);
    let missed = missed_in(&clipped);
    let is_bright = |error: &SfrError| matches!(error, SfrError::Clipped { side: Side::Bright, .. });
    assert!(matches!(&missed, Some(Missed::NoResponse { error, .. }) if is_bright(error)), "{missed:?}");
    // An edge along the columns is sampled once a pixel.
    let upright = missed_in(&alone(0.0, 1.0));
    let is_coarse = |error: &SfrError| matches!(error, SfrError::Angle { .. });
    assert!(matches!(&upright, Some(Missed::NoResponse { error, .. }) if is_coarse(error)), "{upright:?}");
}

#[test]
fn an_edge_at_45_degrees_determines_no_response_above_0_71_cycles_per_pixel() {
    let region = Region { row: 10, col: 10, height: 100, width: 100 };
    let limit = |deg: f64| edge_mtf(&alone(deg, 1.0), &region).unwrap().undetermined_above_per_px();
    let at_45 = limit(45.0).unwrap();
    assert!((at_45 - 0.5f64.sqrt()).abs() < 1e-3, "{at_45}");
    // The other rational slopes sample every half pixel or finer: 1/2, 1/3, 2/3, 3/4.
    for deg in [5.0, 26.565_051, 18.434_949, 33.690_068, 36.869_898, 44.0] {
        assert_eq!(limit(deg), None, "{deg}");
    }
}

#[test]
fn a_sharp_edge_at_45_degrees_is_too_coarse_for_the_colours_of_a_mosaic() {
    // Pixels of one colour sample it every 1.41 pixels of the frame, at every phase of the edge.
    const SHARP: f64 = 0.6;
    let region = Region { row: 0, col: 0, height: ALONE, width: ALONE };
    for offset in [0.0, 0.3, 0.5, 1.0] {
        let value = |i: usize| {
            let middle = 0.5 * ALONE as f64;
            let (x, y) = ((i % ALONE) as f64 + 0.5 - middle - offset, (i / ALONE) as f64 + 0.5 - middle);
            let distance = (x - y) * 0.5f64.sqrt();
            (0.2 + 0.3 * libm::erfc(-distance / (SHARP * 2f64.sqrt()))) as f32
        };
        let values: Vec<f32> = (0..ALONE * ALONE).map(value).collect();
        for channel in raw_channels(&values, ALONE, CfaPattern::RGGB).unwrap() {
            let found = edge_mtf(&channel, &region);
            let is_coarse = |error: &SfrError| matches!(error, SfrError::Angle { gap_px, .. } if (gap_px - 2f64.sqrt()).abs() < 1e-3);
            assert!(found.as_ref().is_err_and(is_coarse), "{} at {offset}: {found:?}", channel.name);
        }
    }
}

#[test]
fn a_picture_without_an_edge_has_no_region() {
    let texture: Vec<f32> = (0..120 * 120).map(|i| ((i * 7919) % 101) as f32).collect();
    let channels = raw_channels(&texture, 120, CfaPattern::MONO).unwrap();
    assert_eq!(found_in(&channels[0]), []);
    assert_eq!(missed_in(&channels[0]), None);
    let tiny = raw_channels(&texture[..9], 3, CfaPattern::MONO).unwrap();
    assert_eq!((found_in(&tiny[0]), missed_in(&tiny[0])), (vec![], None));
}

#[test]
fn regions_are_read_and_checked() {
    assert_eq!("3, 5,60,70".parse(), Ok(Region { row: 3, col: 5, height: 60, width: 70 }));
    for wrong in ["", "1,2,3", "1,2,3,4,5", "1,2,-3,4", "1;2;3;4"] {
        assert!(wrong.parse::<Region>().unwrap_err().contains("ROW,COL,HEIGHT,WIDTH"), "{wrong}");
    }
    let region = Region { row: 10, col: 20, height: 30, width: 40 };
    assert!(region.is_inside(40, 60) && !region.is_inside(39, 60) && !region.is_inside(40, 59));
    assert!(!Region { row: usize::MAX, ..region }.is_inside(40, 60));
}

#[test]
fn a_search_that_is_cancelled_ends_before_its_next_window() {
    let cancel = Cancel::default();
    cancel.set();
    let channel = alone(5.0, 1.0);
    assert_eq!(find_edges(&channel, &cancel), Err(Cancelled));
    assert_eq!(missed_edge(&channel, &cancel), Err(Cancelled));
}
