//! Captured and simulated histograms (Figs. 7 and 8 of Tseng et al.), each with a measure of their agreement.

use petzval_camera::sensor::Colour;
use petzval_lab::emva::captures::Kind;
use petzval_lab::emva::{Characterization, HistogramComparison, PointHistogram};

use super::style::{Around, colour_name, gain_name, sheet, short, significant};
use crate::palette;
use crate::palette::INK;
use crate::plot::{Axis, Curve, Key, KeyLine, Panel, Pen, Sheet, Steps, span};

/// Largest number of exposures in a picture.
const MOST_EXPOSURES: usize = 4;
/// Largest number of bars of a histogram; with more digital numbers, several share a bar.
const MOST_BARS: usize = 150;
/// Spread of the core of a histogram, in standard deviations to either side of the median.
const CORE_SIGMAS: f64 = 5.0;
/// Share of the samples beyond the core from which the frame mentions it.
const LEAST_BEYOND: f64 = 1e-5;
/// Largest number of bars with which the simulated histogram is drawn as bars too.
const FEW_BARS: usize = 60;
/// Samples of a bar below which simulated counts are not drawn on a logarithmic scale.
const LEAST_EXPECTED: f64 = 0.3;
/// Approximate number of labels on the horizontal axis.
const TICKS: usize = 4;
/// Height of the frames of flat and of dark histograms, px.
const FLAT_PX: f64 = 230.0;
const DARK_PX: f64 = 210.0;
/// Height of the notes in a corner: their first line with its margin, and every other line, px.
const NOTES_PX: [f64; 2] = [25.0, 15.0];

/// One captured histogram, with that of the fitted model if there is one.
struct Compared {
    exposure_s: f64,
    colour: Option<Colour>,
    first_dn: u32,
    captured: Vec<f64>,
    expected: Option<Vec<f64>>,
    note: String,
}

impl Compared {
    fn fitted(h: &HistogramComparison) -> Self {
        Self {
            exposure_s: h.exposure_s,
            colour: h.colour,
            first_dn: h.first_dn,
            captured: h.captured.iter().map(|c| *c as f64).collect(),
            expected: Some(h.expected_after.clone()),
            note: format!(
                "{}χ²/ν {:.2}, TV {:.2} %",
                h.colour.map_or(String::new(), |c| format!("{}: ", colour_name(c))),
                h.after.reduced_chi2,
                100.0 * h.after.total_variation
            ),
        }
    }

    fn alone(h: &PointHistogram) -> Self {
        Self {
            exposure_s: h.exposure_s,
            colour: h.colour,
            first_dn: h.counts.first_dn,
            captured: h.counts.counts.iter().map(|c| *c as f64).collect(),
            expected: None,
            note: String::new(),
        }
    }
}

/// Histograms of a kind at the gain nearest to 1 that has them, as the paper shows, from the darkest exposure on.
fn compared(all: &Characterization, kind: Kind) -> Option<(f64, Vec<Compared>)> {
    let fit = all.histogram_fit.as_ref();
    let gains: Vec<f64> = match fit {
        Some(fit) => fit.histograms.iter().filter(|h| h.kind == kind).map(|h| h.linear_gain).collect(),
        None => all.histograms.iter().filter(|h| h.kind == kind).map(|h| h.linear_gain).collect(),
    };
    let gain = gains.into_iter().min_by(|a, b| a.ln().abs().total_cmp(&b.ln().abs()))?;
    let mut found: Vec<Compared> = match fit {
        Some(fit) => {
            let of = fit.histograms.iter().filter(|h| h.kind == kind && h.linear_gain == gain);
            of.map(Compared::fitted).collect()
        }
        None => {
            // Saturated samples are one bar at the end of the range.
            let is_shown = |h: &&PointHistogram| h.kind == kind && h.linear_gain == gain && h.in_range;
            all.histograms.iter().filter(is_shown).map(Compared::alone).collect()
        }
    };
    found.sort_by(|a, b| a.exposure_s.total_cmp(&b.exposure_s));
    Some((gain, found))
}

/// Exposure times to show: all of a few, else those nearest to equal steps from the shortest to the longest.
fn chosen_times(found: &[Compared]) -> Vec<f64> {
    let mut times: Vec<f64> = found.iter().map(|h| h.exposure_s).collect();
    times.dedup();
    let (Some(first), Some(last), true) = (times.first(), times.last(), times.len() > MOST_EXPOSURES) else {
        return times;
    };
    let step = |i: usize| first + (last - first) * i as f64 / (MOST_EXPOSURES - 1) as f64;
    let nearest =
        |t: f64| times.iter().copied().min_by(|a, b| (a - t).abs().total_cmp(&(b - t).abs())).unwrap_or(t);
    let mut chosen: Vec<f64> = (0..MOST_EXPOSURES).map(|i| nearest(step(i))).collect();
    chosen.dedup();
    chosen
}

/// Digital number below which a share of the samples lies.
fn quantile(h: &Compared, share: f64) -> f64 {
    let wanted = share * h.captured.iter().sum::<f64>();
    let mut sum = 0.0;
    let reached = |count: &f64| {
        sum += count;
        sum >= wanted
    };
    f64::from(h.first_dn) + h.captured.iter().position(reached).unwrap_or(0) as f64
}

/// The core of a histogram, DN: some standard deviations about the median, estimated from the middle 68 % of the
/// samples, so that a few outliers do not widen it.
fn core(h: &Compared) -> (f64, f64) {
    let [low, middle, high] = [0.159, 0.5, 0.841].map(|share| quantile(h, share));
    let reach = CORE_SIGMAS * (0.5 * (high - low)).max(0.5);
    let last = f64::from(h.first_dn) + h.captured.len() as f64 - 1.0;
    ((middle - reach).max(f64::from(h.first_dn)), (middle + reach).min(last))
}

/// Share of the samples beyond the core, on either side.
fn share_beyond(h: &Compared) -> f64 {
    let (low, high) = core(h);
    let is_beyond = |i: usize| !(low..=high).contains(&(f64::from(h.first_dn) + i as f64));
    let beyond: f64 = (0..h.captured.len()).filter(|i| is_beyond(*i)).map(|i| h.captured[i]).sum();
    beyond / h.captured.iter().sum::<f64>().max(1.0)
}

/// Bars of a number of digital numbers each, and the model at their middles. `x` counts digital numbers.
fn add(panel: &mut Panel, h: &Compared, each: usize, least: f64) {
    let (colour, n) = (palette::mosaic(h.colour), h.captured.len());
    let sums = |values: &[f64]| values.chunks(each).map(|part| part.iter().sum()).collect::<Vec<f64>>();
    let edges: Vec<f64> =
        (0..=n.div_ceil(each)).map(|i| f64::from(h.first_dn) - 0.5 + (i * each) as f64).collect();
    panel.steps.push(Steps { colour: colour.into(), edges, heights: sums(&h.captured) });
    if let Some(expected) = &h.expected {
        let edge = |i: usize| f64::from(h.first_dn) - 0.5 + (i * each) as f64;
        let expected = sums(expected);
        let shown = |e: f64| (e >= least).then_some(e);
        // Draw the model as outlines of a few bars, or as a line through the middles of many.
        let points: Vec<Option<[f64; 2]>> = if expected.len() <= FEW_BARS {
            let bar = |(i, e): (usize, &f64)| [edge(i), edge(i + 1)].map(|x| shown(*e).map(|e| [x, e]));
            expected.iter().enumerate().flat_map(bar).collect()
        } else {
            let middle = |(i, e): (usize, &f64)| shown(*e).map(|e| [0.5 * (edge(i) + edge(i + 1)), e]);
            expected.iter().enumerate().map(middle).collect()
        };
        panel.curves.push(Curve { pen: Pen { width: 1.5, ..Pen::thin(INK) }, index: 0, points });
    }
    if !h.note.is_empty() {
        panel.notes.push(h.note.clone());
    }
}

fn around(
    all: &Characterization,
    class: &'static str,
    title: &'static str,
    gain: f64,
    found: &[Compared],
) -> Around {
    let mut keys: Vec<Key> = Vec::new();
    for colour in [Some(Colour::Red), Some(Colour::Green), Some(Colour::Blue), Some(Colour::Clear), None] {
        if found.iter().any(|h| h.colour == colour) {
            let name = colour.map_or("all pixels", colour_name);
            keys.push(Key {
                line: KeyLine::Fill(palette::mosaic(colour).into()),
                name: format!("captured, {name}"),
            });
        }
    }
    let remark = match all.histogram_fit {
        Some(_) => {
            keys.push(Key::pen(
                Pen { width: 1.5, ..Pen::thin(INK) },
                "simulated: the model with the fitted parameters",
            ));
            format!(
                "At linear {}. χ²/ν: reduced chi-square; TV: total variation, half the sum of the differences of probabilities.",
                gain_name(gain)
            )
        }
        None => format!(
            "At linear {}. Captured only: {}.",
            gain_name(gain),
            if all.options.fit_histograms {
                "the captures do not resolve the model well enough to fit it to histograms"
            } else {
                "the model was not fitted to the histograms (--fit-histograms)"
            }
        ),
    };
    Around { class, title, remark, keys, linear_gain: Some(gain) }
}

/// A frame of the histograms of one exposure time.
fn panel(found: &[&Compared], seconds: f64, is_logarithmic: bool) -> Panel {
    let ends = if is_logarithmic {
        // Include the whole tail.
        span(found.iter().flat_map(|h| {
            let first = f64::from(h.first_dn);
            [first, first + h.captured.len() as f64]
        }))
    } else {
        span(found.iter().flat_map(|h| <[f64; 2]>::from(core(h))))
    };
    let (low, high) = ends.unwrap_or((0.0, 1.0));
    let each = (((high - low) / MOST_BARS as f64).ceil() as usize).max(1);
    let tallest = found
        .iter()
        .flat_map(|h| h.captured.chunks(each).map(|part| part.iter().sum::<f64>()))
        .fold(1.0, f64::max);
    let room = 0.02 * (high - low) + 1.0;
    let x = Axis::between((low - room).max(-1.0), high + room, TICKS);
    // Bars end below the notes.
    let notes = found.iter().filter(|h| !h.note.is_empty()).count();
    let notes_px = NOTES_PX[0] + NOTES_PX[1] * notes.saturating_sub(1) as f64;
    let headroom = if notes == 0 { 1.25 } else { (1.0 / (1.0 - notes_px / DARK_PX)).max(1.25) };
    let (y, unit) = match (is_logarithmic, tallest >= 1e4) {
        (true, _) => (Axis::decades(0.5, 1.5 * tallest), ""),
        (false, true) => (Axis::around(0.0, 1e-3 * headroom * tallest, 4), ", thousands"),
        (false, false) => (Axis::around(0.0, headroom * tallest, 4), ""),
    };
    let scale = if unit.is_empty() { 1.0 } else { 1e-3 };
    let samples = match each {
        1 => format!("samples{unit}"),
        n => format!("samples in {n} DN{unit}"),
    };
    let head = format!("{} ms", short(1e3 * seconds, 3));
    let beyond = if is_logarithmic { 0.0 } else { found.iter().map(|h| share_beyond(h)).fold(0.0, f64::max) };
    let x_name = if beyond >= LEAST_BEYOND {
        format!("digital number, DN ({} % of the samples beyond)", significant(100.0 * beyond, 2))
    } else {
        "digital number, DN".to_owned()
    };
    let mut panel = Panel::new(head, [&x_name, &samples], x, y);
    for h in found {
        let scaled = Compared {
            captured: h.captured.iter().map(|c| c * scale).collect(),
            expected: h.expected.as_ref().map(|e| e.iter().map(|e| e * scale).collect()),
            note: if is_logarithmic { String::new() } else { h.note.clone() },
            ..**h
        };
        add(&mut panel, &scaled, each, if is_logarithmic { LEAST_EXPECTED } else { 0.0 });
    }
    panel
}

/// Flat frames at a few exposures.
pub(super) fn flat(all: &Characterization) -> Option<Sheet> {
    let (gain, found) = compared(all, Kind::Flat)?;
    let at = |t: f64| found.iter().filter(|h| h.exposure_s == t).collect::<Vec<_>>();
    let panels: Vec<Panel> = chosen_times(&found).into_iter().map(|t| panel(&at(t), t, false)).collect();
    let around = around(all, "histograms-flat", "Histograms of flat frames", gain, &found);
    Some(sheet(all, around, &panels, 2, FLAT_PX))
}

/// Dark frames at a few exposures: the core with linear counts, and beside it everything with logarithmic ones.
pub(super) fn dark(all: &Characterization) -> Option<Sheet> {
    let (gain, found) = compared(all, Kind::Dark)?;
    let at = |t: f64| found.iter().filter(|h| h.exposure_s == t).collect::<Vec<_>>();
    let panels: Vec<Panel> = chosen_times(&found)
        .into_iter()
        .flat_map(|t| [(t, false), (t, true)])
        .map(|(t, is_logarithmic)| panel(&at(t), t, is_logarithmic))
        .collect();
    let around = around(all, "histograms-dark", "Histograms of dark frames", gain, &found);
    Some(sheet(all, around, &panels, 2, DARK_PX))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dark(seconds: f64, captured: Vec<f64>) -> Compared {
        Compared {
            exposure_s: seconds,
            colour: None,
            first_dn: 60,
            captured,
            expected: None,
            note: String::new(),
        }
    }

    #[test]
    fn hot_pixels_do_not_make_a_spike_of_the_core() {
        let mut captured = vec![0.0; 3000];
        captured[..7].copy_from_slice(&[500.0, 6e3, 24e3, 39e3, 24e3, 6e3, 300.0]);
        (500..700).for_each(|i| captured[i] = 1.0);
        let found = dark(1.0, captured);
        let [linear, log] = [false, true].map(|is_logarithmic| panel(&[&found], 1.0, is_logarithmic));
        assert!(linear.x.low < 61.0 && linear.x.high > 65.0 && linear.x.high < 75.0, "{:?}", linear.x);
        assert!(log.x.high > 3000.0 && log.steps[0].heights.len() <= MOST_BARS + 1);
        // 200 of 100,000 samples.
        assert!(linear.x_name.contains("0.2 % of the samples beyond"), "{}", linear.x_name);
        assert_eq!(log.x_name, "digital number, DN");
    }

    #[test]
    fn exposures_are_shown_in_equal_steps_of_time() {
        let times: Vec<f64> = (1..=60).map(|i| 5e-4 * f64::from(i)).chain([0.5, 1.0, 1.5, 2.0]).collect();
        let found: Vec<Compared> = times.iter().map(|t| dark(*t, vec![1.0])).collect();
        assert_eq!(chosen_times(&found), [5e-4, 0.5, 1.5, 2.0]);
        assert_eq!(chosen_times(&found[..3]), times[..3]);
    }

    #[test]
    fn notes_stand_above_the_bars() {
        let of = |colour, captured: Vec<f64>| Compared {
            exposure_s: 0.01,
            colour: Some(colour),
            first_dn: 500,
            captured,
            expected: None,
            note: "χ²/ν 1.00".to_owned(),
        };
        for scale in [1.0, 37.0, 800.0, 4321.0] {
            let heights: Vec<f64> = [1.0, 5.0, 8.0, 5.0, 1.0].iter().map(|h| scale * h).collect();
            let all: Vec<Compared> = [Colour::Red, Colour::Green, Colour::Blue]
                .into_iter()
                .map(|c| of(c, heights.clone()))
                .collect();
            for count in 1..=3 {
                let found: Vec<&Compared> = all.iter().take(count).collect();
                let panel = panel(&found, 0.01, false);
                let tallest = panel.steps[0].heights.iter().copied().fold(0.0, f64::max);
                // The foot of the last line lies 17 px and 15 px a line below the upper edge.
                let foot_px = 17.0 + 15.0 * (count - 1) as f64 + 4.0;
                let bars_px = DARK_PX.min(FLAT_PX) * (1.0 - panel.y.share(tallest));
                assert!(bars_px > foot_px, "{scale} {count}: {bars_px} {foot_px}");
            }
        }
    }
}
