//! Warnings for a reader: one line for each kind, however many points have it.

use crate::emva::warning::Warning;

/// One line per kind of warning, in the order in which they first occur. Repeats give the count, the first and the worst.
pub fn warning_lines(warnings: &[Warning]) -> Vec<String> {
    let mut kinds: Vec<&'static str> = Vec::new();
    for warning in warnings {
        if !kinds.contains(&warning.name()) {
            kinds.push(warning.name());
        }
    }
    kinds.into_iter().map(|kind| line(kind, warnings.iter().filter(|w| w.name() == kind).collect())).collect()
}

fn line(kind: &str, all: Vec<&Warning>) -> String {
    let text = |w: &Warning| w.to_string().trim_start_matches(&format!("{kind}: ")).to_owned();
    let Some(first) = all.first() else { return String::new() };
    if all.len() == 1 {
        return first.to_string();
    }
    // The first of equally severe warnings counts as the worst.
    let worst = all.iter().skip(1).fold(first, |a, b| if b.severity() > a.severity() { b } else { a });
    let count = all.len();
    match (std::ptr::eq(*first, *worst), first.point()) {
        (false, Some(place)) => format!("{kind}: {count} times (first: {place}), worst: {}", text(worst)),
        (false, None) => format!("{kind}: {count} times, worst: {}", text(worst)),
        (true, _) if first.severity() > 0.0 => {
            format!("{kind}: {count} times, first and worst: {}", text(first))
        }
        (true, _) => format!("{kind}: {count} times, first: {}", text(first)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::emva::measured::{Measured, Unresolved};
    use petzval_camera::sensor::Colour;

    #[test]
    fn each_kind_has_one_line() {
        let uneven = |point: &str, percent| Warning::NotUniform { point: point.to_owned(), percent };
        let dark = |point: &str| Warning::NoDark { point: point.to_owned() };
        let lines = warning_lines(&[
            uneven("flat, 1 ms", 6.0),
            dark("flat, 2 ms"),
            uneven("flat, 3 ms", 9.0),
            uneven("flat, 4 ms", 7.0),
            dark("flat, 5 ms"),
            Warning::HistogramFitStopped { steps: 9 },
        ]);
        assert_eq!(lines.len(), 3, "{lines:?}");
        assert_eq!(
            lines[0],
            "not-uniform: 3 times (first: flat, 1 ms), worst: flat, 3 ms: parts of the flat field differ by 9.0 %"
        );
        assert!(lines[1].starts_with("no-dark: 2 times, first: flat, 2 ms: no usable dark"), "{}", lines[1]);
        assert!(lines[2].starts_with("histogram-fit-stopped: the fit"), "{}", lines[2]);
    }

    #[test]
    fn defects_without_a_resolved_spread_have_no_figure() {
        let known = |dn| Measured::new(dn, 0.01);
        let none = Measured::none(Unresolved::NoStack);
        let defects = |colour, pixels, dark_dn| Warning::DefectPixels {
            linear_gain: 1.0,
            colour,
            pixels,
            first: [3, 4],
            dark_dn,
            flat_dn: [known(0.5), known(7.0)],
            bias_percent: None,
            of_others: Vec::new(),
        };
        let one = defects(Colour::Clear, 1, [none, known(45.0)]).to_string();
        assert_eq!(
            one,
            "defect-pixels: at gain 1, 1 pixel does not answer light, the first in row 3, column 4; results.json lists them. DSNU and \
             PRNU leave them out: pixels differ in the dark by less than is resolved without them and by 45.000 DN with them, in the \
             light by 0.500 DN without them and by 7.000 DN with them"
        );
        let green = defects(Colour::Green, 2, [known(0.1), known(0.2)]).to_string();
        assert!(green.contains("gain 1, 2 green pixels do not"), "{green}");
    }

    #[test]
    fn defects_say_by_how_much_means_over_all_pixels_are_off() {
        let known = |dn| Measured::new(dn, 0.01);
        let defects = |bias_percent| {
            let warning = Warning::DefectPixels {
                linear_gain: 1.0,
                colour: Colour::Clear,
                pixels: 600,
                first: [0, 100],
                dark_dn: [known(1.2), known(4.4)],
                flat_dn: [known(20.0), known(138.0)],
                bias_percent,
                of_others: vec![("R", 0.150_001, "DN/p"), ("QE", 59.996, "%"), ("u_e_sat", 16_123.4, "e-")],
            };
            warning.to_string()
        };
        let end = ". EMVA 1288 averages signals over all pixels: R, QE and u_e_sat are 0.42 % too low by them; without them R 0.15000 DN/p, \
                   QE 59.996 %, u_e_sat 16123 e-";
        assert!(defects(Some(-0.4167)).ends_with(end), "{}", defects(Some(-0.4167)));
        // A bias far below any error of these figures is not worth a sentence.
        assert!(defects(Some(-0.001)).ends_with("138.000 DN with them"), "{}", defects(Some(-0.001)));
    }
}
