//! Wavefronts: Zernike coefficients as bars, errors and Strehl ratios as numbers, one row a field.

use maud::{Markup, html};
use petzval_optics::analysis::{Analysis, Wavefront, ZERNIKE_TERMS};

use super::style::{blank, field_name, scales, short, wavelength_name};
use crate::palette::{INK, MUTED};
use crate::plot::{Axis, Frame, Names, Sheet, px, span};
use crate::{number, palette};

/// Size of the bars' frame, height of a line of numbers, px.
const BARS_PX: [f64; 2] = [470.0, 96.0];
const LINE_PX: f64 = 16.0;
const LEFT_PX: f64 = 118.0;
const TOP_PX: f64 = 34.0;

/// First term of the bars: piston and tilts describe the position of the image, not its quality.
const FIRST_TERM: usize = 4;

/// Columns of numbers: right edges, px, and heads.
const COLUMNS: [(f64, &str); 4] = [(676.0, "wavelength"), (750.0, "RMS"), (820.0, "P–V"), (886.0, "Strehl")];

/// The wavefronts of all fields.
pub(super) fn wavefront(analysis: &Analysis) -> Sheet {
    let shown = nearest_to_reference(analysis);
    let coefficients = |w: &Wavefront| w.zernike_waves.get(shown).cloned().flatten().unwrap_or_default();
    let reach = |w: &Wavefront| {
        span(coefficients(w).into_iter().skip(FIRST_TERM - 1))
            .map_or(0.0, |(low, high)| low.abs().max(high.abs()))
    };
    let scales = scales(&analysis.wavefronts.iter().map(reach).collect::<Vec<f64>>());
    let lines = LINE_PX * (analysis.wavelengths_um.len() + 1) as f64;
    let row_px = lines.max(BARS_PX[1]) + 36.0;
    let last = analysis.wavefronts.len().saturating_sub(1);
    let body = html! {
        @for (row, wave) in analysis.wavefronts.iter().enumerate() {
            @let top = TOP_PX + row as f64 * row_px;
            text x="20" y=(px(top + 0.5 * BARS_PX[1] + 5.0)) fill=(INK) font-size="13.5" font-weight="600" {
                (field_name(wave.field_deg))
            }
            (bars(&coefficients(wave), scales[row], top, row == 0, row == last))
            (numbers(analysis, wave, top))
        }
    };
    let um = analysis.wavelengths_um.get(shown).copied().unwrap_or(f64::NAN);
    Sheet {
        remark: format!(
            "Left: fringe Zernike terms 4 to {ZERNIKE_TERMS} at {}, waves. Right: errors from the sphere about the chief \
             ray, waves, and Strehl ratios.",
            wavelength_name(um)
        ),
        keys: Vec::new(),
        alt: format!("Zernike coefficients, wavefront errors and Strehl ratios of {}", analysis.name),
        height: TOP_PX + analysis.wavefronts.len() as f64 * row_px + 16.0,
        body,
        ..blank(analysis, "wavefront", "Wavefronts")
    }
}

/// Index of the wavelength next to the reference.
pub(super) fn nearest_to_reference(analysis: &Analysis) -> usize {
    let off = |i: &usize| (analysis.wavelengths_um[*i] - analysis.reference_um).abs();
    (0..analysis.wavelengths_um.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0)
}

/// Coefficients as bars; terms of spherical aberration carry their numbers.
fn bars(coefficients: &[f64], reach: f64, top: f64, is_first: bool, is_last: bool) -> Markup {
    let mut x = Axis::between(FIRST_TERM as f64 - 0.7, ZERNIKE_TERMS as f64 + 0.7, 8);
    x.ticks = vec![4.0, 9.0, 16.0, 25.0, 36.0];
    let frame =
        Frame { left: LEFT_PX, top, width: BARS_PX[0], height: BARS_PX[1], x, y: Axis::about_zero(reach) };
    let width = 0.66 * BARS_PX[0] / (ZERNIKE_TERMS - FIRST_TERM + 1) as f64;
    let zero = frame.at([0.0, 0.0])[1];
    let content = html! {
        @if coefficients.is_empty() {
            text x="12" y=(px(zero - 8.0)) fill=(MUTED) font-size="12.5" { "too few rays for coefficients" }
        }
        @for (k, waves) in coefficients.iter().enumerate().skip(FIRST_TERM - 1) {
            @let middle = frame.at([(k + 1) as f64, 0.0])[0];
            (frame.column(middle - 0.5 * width, width, *waves, palette::field(0)))
        }
    };
    let names = Names {
        head: if is_first { "Zernike coefficients" } else { "" },
        x: if is_last { "fringe term" } else { "" },
        y: "waves",
    };
    frame.draw_around(names, content)
}

/// Errors by wavelength as lines of a table.
fn numbers(analysis: &Analysis, wave: &Wavefront, top: f64) -> Markup {
    html! {
        g font-size="12.5" text-anchor="end" fill=(INK) {
            @for (x, head) in COLUMNS { text x=(px(x)) y=(px(top + 4.0)) fill=(MUTED) { (head) } }
            @for (i, um) in analysis.wavelengths_um.iter().enumerate() {
                @let y = px(top + 4.0 + LINE_PX * (i + 1) as f64);
                @let texts = [
                    format!("{} µm", short(*um, 4)),
                    number::fixed(wave.rms_waves[i], 3),
                    number::fixed(wave.peak_to_valley_waves[i], 2),
                    number::fixed(wave.strehl[i].unwrap_or(f64::NAN), 3),
                ];
                @for ((x, _), text) in COLUMNS.iter().zip(&texts) { text x=(px(*x)) y=(y) { (text) } }
            }
        }
    }
}
