//! An optimisation: a lens before and after it, side by side.

use maud::{Markup, html};
use petzval_optics::analysis::Layout;

use crate::layout::{CrossSection, Extent, View};
use crate::number;
use crate::page::{Page, Section, caption, figure, section, with_contents};
use crate::plot::{Bar, BarChart, BarKey, WIDTH_PX, bars_svg, plain};
use crate::prescription::SurfaceView;
use crate::table::{Column, Row, Table};

/// The tallest drawing of a lens, px.
const TALLEST_PX: f64 = 420.0;

/// A lens of the page.
#[derive(Clone, Debug)]
pub struct LensState {
    /// In cross-section, with fans of rays.
    pub layout: Layout,
    /// Its surfaces.
    pub surfaces: Vec<SurfaceView>,
    /// RMS spot radius by field, um.
    pub rms_um: Vec<f64>,
    /// Mean over the fields, um.
    pub mean_rms_um: f64,
    /// The limits that it does not keep, each with by how much.
    pub missed: Vec<String>,
}

/// A figure before and after; `None` where the lens has none.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureRow {
    /// What it is.
    pub name: String,
    /// Its unit; empty for a plain number.
    pub unit: String,
    /// Its value before and after.
    pub values: [Option<f64>; 2],
}

/// An optimisation.
#[derive(Clone, Debug)]
pub struct OptimizeSheet {
    /// Name of the lens.
    pub lens: String,
    /// Fields, degrees.
    pub fields_deg: Vec<f64>,
    /// The lens at the start; `None` where its rays do not reach the image.
    pub before: Option<LensState>,
    /// The best lens.
    pub after: LensState,
    /// Variables of the best lens that stand on a bound.
    pub at_bounds: Vec<String>,
    /// Limits that hold the best lens.
    pub at_limits: Vec<String>,
    /// Figures of both.
    pub figures: Vec<FigureRow>,
}

/// The page. It is self-contained and suitable for printing.
pub fn page(sheet: &OptimizeSheet) -> String {
    let sections: Vec<Section> = vec![
        section("Result", result(sheet)),
        section("Before and after", sections_of(sheet)),
        section("Spots", spots(sheet)),
        section("Figures", figures(sheet)),
        section("What changed", changes(sheet)),
    ];
    Page {
        title: format!("{} – optimised", sheet.lens),
        headline: format!("{}, optimised", sheet.lens),
        main: with_contents(&sections),
        ..Page::default()
    }
    .html()
}

/// The answer in a sentence, then limits and bounds.
fn result(sheet: &OptimizeSheet) -> Markup {
    let um = |value: f64| format!("{}\u{a0}µm", number::fixed(value, 2));
    let list = |title: &str, items: &[String]| {
        html! {
            @if !items.is_empty() {
                p { (title) }
                ul { @for item in items { li { (plain(item)) } } }
            }
        }
    };
    let after = &sheet.after;
    html! {
        p {
            "The mean RMS spot is " strong { (um(after.mean_rms_um)) }
            @if let Some(before) = &sheet.before { ", and was " (um(before.mean_rms_um)) }
            "."
            @if after.missed.is_empty() { " All limits are kept." } @else { " No lens was found that keeps every limit." }
        }
        (list("Not kept:", &after.missed))
        @if let Some(before) = &sheet.before { (list("Not kept by the lens at the start:", &before.missed)) }
        @if sheet.before.is_none() { p { "Rays of the lens at the start do not reach the image." } }
        (list("At its limit:", &sheet.at_limits))
        (list("On a bound, where a wider range may give smaller spots:", &sheet.at_bounds))
    }
}

/// Both lenses to one scale.
fn sections_of(sheet: &OptimizeSheet) -> Markup {
    let drawn = |name: &'static str, state: &LensState| {
        let of = CrossSection {
            name,
            layout: &state.layout,
            fields_deg: &sheet.fields_deg,
            half_diagonal_mm: 0.0,
            ghost: None,
        };
        (of.extent(), name, state.layout.clone())
    };
    let mut all: Vec<(Extent, &str, Layout)> = Vec::new();
    all.extend(sheet.before.as_ref().map(|before| drawn("before", before)));
    all.push(drawn("after", &sheet.after));
    let extent = all.iter().skip(1).fold(all[0].0, |extent, (other, ..)| extent.union(*other));
    let scale = View::fitting(extent, [WIDTH_PX, TALLEST_PX]).px_per_mm;
    html! {
        @for (_, name, layout) in &all {
            h3 { @if *name == "before" { "Before" } @else { "After" } }
            (figure(&CrossSection {
                name,
                layout,
                fields_deg: &sheet.fields_deg,
                half_diagonal_mm: 0.0,
                // The lens before stands behind the one after it.
                ghost: all.first().filter(|_| *name == "after" && all.len() > 1).map(|(.., before)| before),
            }
            .svg(scale, extent)))
        }
        (caption("To one scale, with rays of each field. The lens before is dashed behind the lens after."))
    }
}

/// The spots of every field as bars.
fn spots(sheet: &OptimizeSheet) -> Markup {
    let states: Vec<&LensState> = sheet.before.iter().chain([&sheet.after]).collect();
    let names = if states.len() > 1 { &["before", "after"][..] } else { &["after"][..] };
    let bar = |(i, field): (usize, &f64)| Bar {
        name: format!("{}°", number::short(*field, 2)),
        values: states.iter().map(|state| state.rms_um.get(i).copied().unwrap_or(f64::NAN)).collect(),
    };
    let chart = BarChart {
        alt: "RMS spot radius of each field before and after".to_owned(),
        axis: "RMS spot radius, µm".to_owned(),
        keys: names.iter().enumerate().map(|(k, name)| BarKey::nth(k, name)).collect(),
        bars: sheet.fields_deg.iter().enumerate().map(bar).collect(),
    };
    html! {
        (figure(&bars_svg(&chart)))
        (caption(
            "All wavelengths together, through the stop, each ray with its light. The image plane before is where the spots are least, or the error after \
             restoration if that is the goal; the one after is that of the lens file."
        ))
    }
}

fn figures(sheet: &OptimizeSheet) -> Markup {
    let columns =
        [Column::new("figure"), Column::new("before"), Column::new("after"), Column::new("unit").units()];
    let row = |f: &FigureRow| {
        let [before, after] = f.values.map(|v| v.map_or("–".to_owned(), |v| number::fixed(v, 4)));
        Row::new(plain(&f.name), [before, after, number::unit(&f.unit)])
    };
    Table::new(columns).rows(sheet.figures.iter().map(row)).html()
}

/// The numbers of the surfaces that differ.
fn changes(sheet: &OptimizeSheet) -> Markup {
    let Some(before) = &sheet.before else {
        return html! { p { "There is no lens before to compare with." } };
    };
    let mut rows = Vec::new();
    for (i, (a, b)) in before.surfaces.iter().zip(&sheet.after.surfaces).enumerate() {
        let mut add = |what: String, a: String, b: String, unit: &str| {
            if a != b {
                rows.push(Row::new((i + 1).to_string(), [what, a, b, unit.to_owned()]));
            }
        };
        let of_radius = |s: &SurfaceView| {
            if s.radius_mm.is_finite() { number::significant(s.radius_mm) } else { "plane".to_owned() }
        };
        add("radius".into(), of_radius(a), of_radius(b), "mm");
        let thickness = |s: &SurfaceView| number::fixed(s.thickness_mm, 4);
        add("thickness".into(), thickness(a), thickness(b), "mm");
        add("glass".into(), a.glass.clone(), b.glass.clone(), "");
        let conic = |s: &SurfaceView| number::fixed(s.conic, 4);
        add("conic".into(), conic(a), conic(b), "");
        let mut orders: Vec<usize> = a.asphere.iter().chain(&b.asphere).map(|(order, _)| *order).collect();
        orders.sort_unstable();
        orders.dedup();
        for order in orders {
            let of = |s: &SurfaceView| {
                let found = s.asphere.iter().find(|(own, _)| *own == order);
                found.map_or("0".to_owned(), |(_, value)| number::significant(*value))
            };
            add(format!("a{order}"), of(a), of(b), "mm¹⁻ⁿ");
        }
        let semi = |s: &SurfaceView| number::fixed(s.semi_diameter_mm, 3);
        add("semi-diameter".into(), semi(a), semi(b), "mm");
    }
    let columns = [
        Column::new("surface"),
        Column::new("number").text(),
        Column::new("before"),
        Column::new("after"),
        Column::new("unit").units(),
    ];
    html! {
        @if rows.is_empty() { p { "Nothing: the lens ended where it began." } }
        @else { (Table::new(columns).rows(rows).html()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::assert_readable;
    use crate::sample::{layout_of, surfaces, triplet};

    fn sheet() -> OptimizeSheet {
        let fields_deg = vec![0.0, 15.0];
        let state = |rms: f64, missed: &[&str]| LensState {
            layout: layout_of(&triplet(), &fields_deg, 9),
            surfaces: surfaces(),
            rms_um: vec![rms, 2.0 * rms],
            mean_rms_um: 1.5 * rms,
            missed: missed.iter().map(|m| (*m).to_owned()).collect(),
        };
        let mut after = state(4.0, &[]);
        after.surfaces[0].radius_mm *= 1.25;
        let figures =
            vec![FigureRow { name: "focal length".into(), unit: "mm".into(), values: [Some(25.0), None] }];
        let before = Some(state(8.0, &["edge thickness behind surface 1, by 0.2000 mm"]));
        let at_bounds = vec!["radius_mm of surface 5 at 20.2".to_owned()];
        let at_limits = vec!["track".to_owned()];
        OptimizeSheet { lens: "<i>lens".into(), fields_deg, before, after, at_bounds, at_limits, figures }
    }

    #[test]
    fn the_page_answers_first_and_lists_what_changed() {
        let text = page(&sheet());
        assert_readable(&text);
        assert!(text.contains("<strong>6.00\u{a0}µm</strong>, and was 12.00\u{a0}µm"), "{text}");
        assert!(text.contains("All limits are kept") && text.contains("edge thickness behind surface 1"));
        assert!(text.contains("radius_mm of surface 5 at 20.2") && text.contains("&lt;i&gt;lens"));
        // One number of one surface differs.
        let changed = text.split("What changed").last().unwrap();
        assert_eq!(changed.matches("<tr").count(), 2, "{changed}");
        assert_eq!(text.matches("<figure").count(), 3);
    }

    #[test]
    fn a_start_without_an_image_is_said() {
        let text = page(&OptimizeSheet { before: None, ..sheet() });
        assert_readable(&text);
        assert!(text.contains("do not reach the image") && !text.contains(", and was"));
    }
}
