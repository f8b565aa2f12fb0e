//! A tolerance analysis: what each tolerance costs, and how good lenses made at random are.

use maud::{Markup, html};

use crate::number;
use crate::page::{Page, Section, caption, facts, figure, section, with_contents};
use crate::palette::{self, MUTED};
use crate::plot::{
    Axis, Bar, BarChart, BarKey, Chart, Curve, Key, KeyLine, Mark, Panel, Pen, Series, Sheet, Steps,
    WIDTH_PX, bars_svg, chart_svg, grid, plain, span,
};
use crate::table::{Column, Row, Table};

/// Tolerances whose effect is drawn, and those that the page lists at once.
const BARS: usize = 20;
const LISTED: usize = 12;

/// Height of the frame of the histogram, px.
const HISTOGRAM_PX: f64 = 260.0;

/// Decimals of shares, percent.
const SHARE_DECIMALS: usize = 1;

/// A tolerance analysis. Merits are in the unit of the merit.
#[derive(Clone, Debug, Default)]
pub struct ToleranceSheet {
    /// Name of the lens.
    pub lens: String,
    /// Name of the merit.
    pub merit: String,
    /// Its unit; empty for a plain number.
    pub unit: String,
    /// Whether larger values of it are better.
    pub higher_is_better: bool,
    /// The merit of the lens as drawn, compensators adjusted.
    pub nominal: f64,
    /// Names of the compensators.
    pub compensators: Vec<String>,
    /// What each tolerance does, the greatest effect first.
    pub rows: Vec<ToleranceRow>,
    /// Lenses as built, estimated from these rows, if every lens at a tolerance has an image.
    pub estimate: Option<BuiltEstimate>,
    /// Lenses made at random.
    pub random: Option<RandomLenses>,
}

/// What a tolerance does.
#[derive(Clone, Debug, PartialEq)]
pub struct ToleranceRow {
    /// What is off.
    pub name: String,
    /// The tolerance.
    pub tolerance: f64,
    /// Its unit; empty for a plain number.
    pub unit: String,
    /// Distribution of the errors, in a word.
    pub distribution: String,
    /// Merit at minus and at plus the tolerance, compensators adjusted; `None` without an image, or if that lens cannot be built.
    pub merit_at: [Option<f64>; 2],
    /// Whether the lens at minus, and that at plus the tolerance cannot be built.
    pub is_unbuildable: [bool; 2],
    /// The tolerance that costs an even share of a given loss, and whether even a far wider one costs less.
    pub even_share: Option<(f64, bool)>,
}

/// Lenses as built, estimated from the effects of single tolerances; NaN where unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuiltEstimate {
    /// The nominal merit, worse by the root of the sum of squares of all changes.
    pub root_sum_square: f64,
    /// Mean to second order.
    pub mean: f64,
    /// Standard deviation to second order.
    pub standard_deviation: f64,
}

/// Lenses made at random.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RandomLenses {
    /// Seed of their errors.
    pub seed: u64,
    /// How many were made.
    pub trials: usize,
    /// How many of them cannot be built.
    pub unbuildable: usize,
    /// Merits of those that have an image, from the best to the worst.
    pub merits: Vec<f64>,
    /// Their mean and standard deviation; NaN where unknown.
    pub mean_and_deviation: [f64; 2],
    /// Percentages of all lenses, and the merit that they reach; `None` if too many have none.
    pub percentiles: Vec<(f64, Option<f64>)>,
    /// A merit that lenses have to reach, and the share of all lenses that do, 0..1.
    pub limit: Option<(f64, f64)>,
    /// How far the compensators go.
    pub travels: Vec<CompensatorTravel>,
    /// The worst lenses, the worst first.
    pub worst: Vec<WorstLens>,
}

impl RandomLenses {
    /// Decimals up to the standard error of a mean over the lenses, at most so many.
    fn decimals(&self, deviation: f64, most: usize) -> usize {
        let error = deviation / (self.merits.len() as f64).sqrt();
        number::decimals_of(error).map_or(most, |known| (known.max(0) as usize).min(most))
    }

    /// A share of the lenses, 0..1, in per cent. It ends where its standard error begins, `sqrt(p (1 - p) / n)`.
    fn percent(&self, share: f64) -> String {
        let error = 100.0 * (share * (1.0 - share) / self.trials as f64).sqrt();
        let decimals =
            number::decimals_of(error).map_or(0, |known| (known.max(0) as usize).min(SHARE_DECIMALS));
        format!("{} %", number::fixed(100.0 * share, decimals))
    }
}

/// How far a compensator goes over the lenses, counted from the lens as drawn; NaN where unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct CompensatorTravel {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Mean, standard deviation, lowest and highest place.
    pub places: [f64; 4],
}

/// One of the worst lenses.
#[derive(Clone, Debug, PartialEq)]
pub struct WorstLens {
    /// Its number.
    pub number: usize,
    /// Its merit; `None` without an image.
    pub merit: Option<f64>,
    /// Its largest errors in units of their tolerances, as they would hurt: names and shares, the most harmful first.
    pub errors: Vec<(String, f64)>,
}

impl ToleranceSheet {
    /// A merit with its unit.
    fn with_unit(&self, value: f64) -> String {
        self.united(self.value(value))
    }

    /// A merit of the random lenses with its unit.
    fn random_with_unit(&self, random: &RandomLenses, value: f64) -> String {
        self.united(self.random_value(random, value))
    }

    /// A number with the unit of merits.
    fn united(&self, value: String) -> String {
        let unit = number::unit(&self.unit);
        if unit.is_empty() { value } else { format!("{value}\u{a0}{unit}") }
    }

    /// A merit.
    fn value(&self, value: f64) -> String {
        number::fixed(value, self.decimals())
    }

    /// A merit of the random lenses. It ends where the standard error of their mean begins, `s / sqrt(n)`.
    fn random_value(&self, random: &RandomLenses, value: f64) -> String {
        number::fixed(value, random.decimals(random.mean_and_deviation[1], self.decimals()))
    }

    /// Decimals of merits that are computed.
    fn decimals(&self) -> usize {
        if self.unit.is_empty() { 4 } else { 3 }
    }

    /// An axis for merits.
    fn axis(&self, what: &str) -> String {
        let unit =
            if self.unit.is_empty() { String::new() } else { format!(", {}", number::unit(&self.unit)) };
        format!("{what}{}{unit}", self.merit)
    }

    /// How much worse a merit is than that of the lens as drawn; infinite without an image.
    fn loss(&self, merit: Option<f64>) -> f64 {
        let sign = if self.higher_is_better { -1.0 } else { 1.0 };
        merit.map_or(f64::INFINITY, |merit| sign * (merit - self.nominal))
    }
}

/// The greatest effects as bars.
pub fn sensitivity_svg(sheet: &ToleranceSheet) -> String {
    let bar = |row: &ToleranceRow| Bar {
        name: format!("{}, {} {}", row.name, three_digits(row.tolerance), number::unit(&row.unit)),
        values: row.merit_at.map(|merit| sheet.loss(merit)).to_vec(),
    };
    bars_svg(&BarChart {
        alt: format!("What each tolerance costs of the {}", sheet.merit),
        axis: sheet.axis("loss of "),
        keys: vec![BarKey::nth(0, "at minus the tolerance"), BarKey::nth(1, "at plus")],
        bars: sheet.rows.iter().take(BARS).map(bar).collect(),
    })
}

/// The share of lenses over the merit that they reach, with marks at the nominal merit, at those of 50 % and 90 %, and at the limit.
pub fn yield_svg(sheet: &ToleranceSheet, random: &RandomLenses) -> String {
    let share = |i: usize| 100.0 * (i + 1) as f64 / random.trials as f64;
    let mut curve: Vec<(f64, f64)> =
        random.merits.iter().enumerate().map(|(i, merit)| (*merit, share(i))).collect();
    if sheet.higher_is_better {
        curve.reverse();
    }
    chart_svg(&Chart {
        alt: format!("Yield of {} lenses over their {}", random.trials, sheet.merit),
        x_axis: sheet.axis(""),
        y_axis: "lenses that reach it, %".into(),
        series: vec![Series {
            name: "yield".into(),
            colour: palette::field(0).into(),
            points: curve,
            ..Series::default()
        }],
        marks: marks(sheet, random)
            .into_iter()
            .map(|(name, colour, at)| Mark { name, colour: colour.into(), at })
            .collect(),
        ..Chart::default()
    })
}

/// How many of the lenses have each merit, with the same marks.
pub fn histogram_svg(sheet: &ToleranceSheet, random: &RandomLenses) -> String {
    let Some((low, high)) = span(random.merits.iter().copied()) else { return String::new() };
    // Bins as narrow as their counts stay steady: the square root of the number, as is customary.
    let bins = (random.merits.len() as f64).sqrt().ceil().clamp(1.0, 60.0);
    let step = if high > low { number::round_length((high - low) / bins) } else { 1.0 };
    let first = (low / step).floor();
    let count = ((high / step).floor() - first) as usize + 1;
    let mut heights = vec![0.0; count];
    for merit in &random.merits {
        heights[(((merit / step).floor() - first) as usize).min(count - 1)] += 1.0;
    }
    let edges: Vec<f64> = (0..=count).map(|i| (first + i as f64) * step).collect();
    let marks = marks(sheet, random);
    let (from, to) =
        span(edges.iter().copied().chain(marks.iter().map(|mark| mark.2))).unwrap_or((low, high));
    let air = 0.02 * (to - from);
    let tallest = heights.iter().copied().fold(0.0, f64::max);
    let names = [sheet.axis(""), "lenses".to_owned()];
    let mut panel = Panel::new(
        "",
        [names[0].as_str(), names[1].as_str()],
        Axis::between(from - air, to + air, 8),
        Axis::between(0.0, 1.08 * tallest, 5),
    );
    panel.steps.push(Steps { colour: palette::field(0).into(), edges, heights });
    let pen = |colour: &str| Pen::thin(colour).dashed();
    let mut keys =
        vec![Key { line: KeyLine::Fill(palette::field(0).into()), name: "lenses made at random".into() }];
    for (name, colour, at) in marks {
        let upright = [panel.y.low, panel.y.high].map(|y| Some([at, y]));
        panel.curves.push(Curve { pen: pen(colour), index: 0, points: upright.into() });
        keys.push(Key::pen(pen(colour), name));
    }
    let (body, height) = grid(&[panel], 1, WIDTH_PX, HISTOGRAM_PX);
    Sheet {
        class: "histogram",
        keys,
        alt: format!("Distribution of the {} of {} lenses", sheet.merit, random.trials),
        width: WIDTH_PX,
        height,
        body,
        ..Sheet::default()
    }
    .svg()
}

/// Names, colours and merits of the marks of a distribution.
fn marks(sheet: &ToleranceSheet, random: &RandomLenses) -> Vec<(String, &'static str, f64)> {
    let mut marks = vec![(format!("as drawn: {}", sheet.with_unit(sheet.nominal)), MUTED, sheet.nominal)];
    for (percent, colour) in [(50.0, palette::field(1)), (90.0, palette::field(2))] {
        let reached = random.percentiles.iter().find(|p| p.0 == percent).and_then(|p| p.1);
        marks.extend(
            reached.map(|at| (format!("{percent} %: {}", sheet.random_with_unit(random, at)), colour, at)),
        );
    }
    marks.extend(
        random
            .limit
            .map(|(limit, _)| (format!("limit: {}", sheet.with_unit(limit)), palette::field(3), limit)),
    );
    marks
}

/// The page. It is self-contained and suitable for printing.
pub fn page(sheet: &ToleranceSheet) -> String {
    let mut sections: Vec<Section> = vec![section("Summary", summary(sheet))];
    if let Some(random) = &sheet.random {
        sections.push(section("Lenses made at random", distribution(sheet, random)));
    }
    sections.push(section("What each tolerance costs", effects(sheet)));
    if let Some(random) = sheet.random.as_ref().filter(|random| !random.worst.is_empty()) {
        sections.push(section("The worst lenses", worst(sheet, random)));
    }
    Page {
        title: format!("{} – tolerances", sheet.lens),
        headline: format!("Tolerances of {}", sheet.lens),
        subtitle: html! { "Judged by: " (plain(&sheet.merit)) ", " (if sheet.higher_is_better { "the more the better." } else { "the less the better." }) },
        main: with_contents(&sections),
        ..Page::default()
    }
    .html()
}

/// The result in a few sentences, and the figures.
fn summary(sheet: &ToleranceSheet) -> Markup {
    let random = sheet.random.as_ref();
    let reached = |percent: f64| {
        let at = random?.percentiles.iter().find(|p| p.0 == percent)?.1?;
        Some(sheet.random_with_unit(random?, at))
    };
    let adjusted = match &sheet.compensators[..] {
        [] => "Nothing is adjusted on a finished lens.".to_owned(),
        names => format!("Adjusted on every lens: {}.", names.join(", ")),
    };
    let reach = if sheet.higher_is_better { "at least" } else { "at most" };
    let value = |v: f64| v.is_finite().then(|| sheet.with_unit(v));
    let of_random = |i: usize| {
        let random = random.filter(|random| random.mean_and_deviation[i].is_finite())?;
        Some(sheet.random_with_unit(random, random.mean_and_deviation[i]))
    };
    let reach_limit = random.and_then(|r| Some((r.limit?.0, r.percent(r.limit?.1))));
    let estimate = sheet.estimate.as_ref();
    html! {
        p {
            "As drawn the lens has " (sheet.with_unit(sheet.nominal)) "."
            @if let Some(at) = reached(90.0) {
                " Nine in ten lenses made within the tolerances have " (reach) " " (at) "."
            }
            @if let Some((limit, share)) = &reach_limit {
                " The limit of " (sheet.with_unit(*limit)) " is reached by " (share) " of them."
            }
            @if let Some(row) = sheet.rows.first() {
                " The most expensive tolerance is " (plain(&row.name)) ", " (tolerance(row)) "."
            }
            " " (adjusted)
        }
        @if sheet.estimate.is_none() && !sheet.rows.is_empty() {
            p { "There is no estimate from the single effects: a lens at the end of a tolerance has no image or cannot be built." }
        }
        (facts([
            ("as drawn", value(sheet.nominal)),
            ("tolerances", Some(sheet.rows.len().to_string())),
            ("root sum square of all tolerances", estimate.and_then(|e| value(e.root_sum_square))),
            ("mean, estimated from single effects", estimate.and_then(|e| value(e.mean))),
            ("standard deviation, estimated", estimate.and_then(|e| value(e.standard_deviation))),
            ("lenses made at random", random.map(|r| r.trials.to_string())),
            ("of these without an image", random.map(|r| (r.trials - r.merits.len() - r.unbuildable).to_string())),
            ("of these cannot be built", random.map(|r| r.unbuildable.to_string())),
            ("mean of the others", of_random(0)),
            ("standard deviation of the others", of_random(1)),
            ("limit", random.and_then(|r| value(r.limit?.0))),
            ("lenses that reach the limit", reach_limit.map(|(_, share)| share)),
            ("seed", random.map(|r| r.seed.to_string())),
        ]))
    }
}

/// Histogram, yield, percentiles, and how far compensators go.
fn distribution(sheet: &ToleranceSheet, random: &RandomLenses) -> Markup {
    let of_percent = |(percent, merit): &(f64, Option<f64>)| {
        Row::new(
            format!("{} %", number::short(*percent, 1)),
            [merit.map_or("–".into(), |m| sheet.random_value(random, m))],
        )
    };
    let reach = if sheet.higher_is_better { "have at least" } else { "have at most" };
    let unit = number::unit(&sheet.unit);
    let percentiles = Table::new([Column::new("lenses"), Column::new(reach).unit(&unit)])
        .class("narrow")
        .rows(random.percentiles.iter().map(of_percent));
    let travel = |t: &CompensatorTravel| {
        let [mean, deviation, lowest, highest] = t.places;
        let decimals = random.decimals(deviation, 4);
        let places = [(mean, decimals), (deviation, decimals), (lowest, 4), (highest, 4)];
        let places = places.map(|(v, decimals)| number::fixed(v, decimals));
        Row::new(plain(&t.name), places.into_iter().chain([number::unit(&t.unit)]))
    };
    let names = ["compensator", "mean", "standard deviation", "lowest", "highest"].map(Column::new);
    let travels = Table::new(names.into_iter().chain([Column::new("unit").units()]))
        .rows(random.travels.iter().map(travel));
    html! {
        @if random.merits.is_empty() {
            p { "None of the lenses can be built and has an image." }
        } @else {
            (figure(&histogram_svg(sheet, random)))
            (caption("How many of the lenses have which merit."))
            (figure(&yield_svg(sheet, random)))
            (caption("The share of all lenses whose merit is at least as good. Lenses without an image, and those that cannot be built, count as failed."))
            (percentiles.html())
        }
        @if !random.travels.is_empty() {
            (travels.html())
            (caption("How far the compensators have to go, counted from the lens as drawn."))
        }
    }
}

/// The greatest effects as bars and as a table.
fn effects(sheet: &ToleranceSheet) -> Markup {
    let unit = number::unit(&sheet.unit);
    let has_shares = sheet.rows.iter().any(|row| row.even_share.is_some());
    let mut columns = vec![
        Column::new("quantity"),
        Column::new("tolerance").unit("±"),
        Column::new("unit").units(),
        Column::new("distribution").text(),
        Column::new("at minus").unit(&unit),
        Column::new("at plus").unit(&unit),
        Column::new("worst loss").unit(&unit),
    ];
    if has_shares {
        columns.push(Column::new("for an even share").unit("±"));
    }
    let row = |row: &ToleranceRow| {
        let change = |end: usize| {
            let none = if row.is_unbuildable[end] { "not buildable" } else { "no image" };
            row.merit_at[end].map_or(none.into(), |m| sheet.value(m))
        };
        let [minus, plus] = row.merit_at.map(|merit| sheet.loss(merit));
        let worst = minus.max(plus);
        let mut cells = vec![
            three_digits(row.tolerance),
            number::unit(&row.unit),
            row.distribution.clone(),
            change(0),
            change(1),
            if worst.is_finite() {
                number::signed(worst, if sheet.unit.is_empty() { 4 } else { 3 })
            } else {
                "∞".into()
            },
        ];
        if has_shares {
            cells.push(row.even_share.map_or("–".into(), |(tolerance, is_free)| {
                format!("{}{}", if is_free { "> " } else { "" }, three_digits(tolerance))
            }));
        }
        Row::new(plain(&row.name), cells)
    };
    let table = |rows: &[ToleranceRow]| Table::new(columns.clone()).rows(rows.iter().map(row)).html();
    let (first, rest) = sheet.rows.split_at(sheet.rows.len().min(LISTED));
    html! {
        (figure(&sensitivity_svg(sheet)))
        (caption("The loss of the merit with one quantity off by its tolerance, compensators adjusted: the worst offenders first."))
        (table(first))
        @if !rest.is_empty() {
            details {
                summary { (rest.len()) " more of less effect" }
                (table(rest))
            }
        }
        @if has_shares {
            (caption("Even share: the tolerance with which every quantity costs the required loss over the root of their number, so that all cost it as a root sum square; > where even a far wider one costs less."))
        }
    }
}

/// The worst lenses with their most harmful errors.
fn worst(sheet: &ToleranceSheet, random: &RandomLenses) -> Markup {
    let columns = [
        Column::new("lens"),
        Column::new(&sheet.merit).unit(number::unit(&sheet.unit)),
        Column::new("largest harmful errors, in tolerances").note(),
    ];
    let row = |lens: &WorstLens| {
        let errors: Vec<String> = lens
            .errors
            .iter()
            .map(|(name, share)| format!("{} {}", plain(name), number::signed(*share, 2)))
            .collect();
        let merit = lens.merit.map_or("no image".into(), |m| sheet.value(m));
        Row::new(lens.number.to_string(), [merit, errors.join(", ")])
    };
    html! {
        (Table::new(columns).rows(random.worst.iter().map(row)).html())
        (caption("Numbers are those of the list of trials. Errors by the loss that each alone would cost, from the slopes and bends of the table above."))
    }
}

/// A tolerance with its unit.
fn tolerance(row: &ToleranceRow) -> String {
    match number::unit(&row.unit).as_str() {
        "" => format!("±{}", three_digits(row.tolerance)),
        unit => format!("±{}\u{a0}{unit}", three_digits(row.tolerance)),
    }
}

/// A number with three significant digits and no trailing zeros.
pub fn three_digits(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = (2 - value.abs().log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::assert_readable;

    fn sheet() -> ToleranceSheet {
        let row = |name: &str, merit_at| ToleranceRow {
            name: name.into(),
            tolerance: 0.05,
            unit: "mm".into(),
            distribution: "uniform".into(),
            merit_at,
            is_unbuildable: [name == "air", false],
            even_share: None,
        };
        let merits: Vec<f64> = (0..100).map(|i| 13.005 + 0.01 * f64::from(i)).collect();
        ToleranceSheet {
            lens: "a <triplet>".into(),
            merit: "RMS spot (root mean square over the fields)".into(),
            unit: "um".into(),
            nominal: 13.1,
            compensators: vec!["image distance".into()],
            rows: vec![
                row("surface 1 thickness", [Some(13.0), Some(13.6)]),
                row("tilt", [None, Some(13.2)]),
                row("air", [None, Some(13.2)]),
            ],
            random: Some(RandomLenses {
                seed: 7,
                trials: 106,
                unbuildable: 2,
                merits,
                mean_and_deviation: [13.495, 0.29],
                percentiles: vec![(50.0, Some(13.5)), (90.0, Some(13.9)), (99.0, None)],
                limit: Some((13.4, 0.394)),
                travels: vec![CompensatorTravel {
                    name: "image distance".into(),
                    unit: "mm".into(),
                    places: [0.01, 0.05, -0.1, 0.2],
                }],
                worst: vec![WorstLens { number: 42, merit: None, errors: vec![("tilt".into(), -0.97)] }],
            }),
            ..ToleranceSheet::default()
        }
    }

    #[test]
    fn the_summary_has_yield_limit_and_worst_offender() {
        let page = page(&sheet()).replace('\u{a0}', " ");
        for words in [
            "Tolerances of a &lt;triplet&gt;",
            "As drawn the lens has 13.100 µm.",
            "Nine in ten lenses made within the tolerances have at most 13.90 µm.",
            "The limit of 13.400 µm is reached by 39 % of them.",
            "The most expensive tolerance is surface 1 thickness, ±0.05 mm.",
            "<dt>of these without an image</dt><dd>4</dd>",
            "<dt>of these cannot be built</dt><dd>2</dd>",
            "not buildable",
            // 0.29 of 100 lenses: means are known to 0.029.
            "<dt>mean of the others</dt><dd>13.49 µm</dd>",
            "<dt>standard deviation of the others</dt><dd>0.29 µm</dd>",
            "+0.500",
            "no image",
            "tilt \u{2212}0.97",
        ] {
            assert!(page.contains(words), "{words}");
        }
        assert!(!page.contains("NaN") && !page.contains("inf"));
        assert_readable(&page);
    }

    #[test]
    fn the_histogram_counts_every_lens_once() {
        let (sheet, random) = (sheet(), sheet().random.unwrap());
        let svg = histogram_svg(&sheet, &random);
        // 100 merits over 0.99 in bins of 0.1: ten bins of ten lenses, of equal height, and the way back to the axis.
        let d = svg.split("class=\"steps\" d=\"").nth(1).unwrap().split('"').next().unwrap();
        let tops: Vec<&str> =
            d.split('V').skip(1).map(|part| part.split(['H', 'z']).next().unwrap()).collect();
        assert_eq!(tops.len(), 11, "{d}");
        assert!(tops[..10].iter().all(|y| *y == tops[0]) && tops[10] != tops[0], "{d}");
        // As drawn, 50 %, 90 %, and the limit.
        assert_eq!(svg.matches("class=\"curve\"").count(), 4);
        let one = RandomLenses { merits: vec![13.0; 3], trials: 3, ..random };
        assert!(!histogram_svg(&sheet, &one).contains("NaN"));
    }

    #[test]
    fn an_analysis_without_random_lenses_is_a_page() {
        let page = page(&ToleranceSheet { random: None, ..sheet() });
        assert!(!page.contains("random") && page.contains("worst offenders"));
        assert_readable(&page);
    }
}
