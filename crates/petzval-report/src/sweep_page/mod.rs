//! A sweep on one page: the table of its units, one scatter plot, the same picture by every unit, and the units that failed.

mod scatter;

use maud::{Markup, html};

use crate::page::{Page, Section, caption, figure, section, with_contents};
use crate::png;
use crate::table::{Column, Row, Table};

pub use scatter::{Scatter, ScatterGroup};

/// What came out of a sweep.
#[derive(Clone, Debug, Default)]
pub struct SweepView {
    /// Title of the sweep.
    pub title: String,
    /// How many units are finished, and what else is to be said of all.
    pub subtitle: String,
    /// The result in a sentence; none where units do not differ.
    pub answer: Option<String>,
    /// Figures that are the same in every unit, with their values. They have no column.
    pub constant: Vec<(String, String)>,
    /// Keys that vary and that the table shows, each a column.
    pub keys: Vec<String>,
    /// Name and unit of every figure, each a column.
    pub figures: Vec<(String, String)>,
    /// The rows.
    pub rows: Vec<SweepRow>,
    /// Two quantities of every unit against each other.
    pub scatter: Option<Scatter>,
    /// The same picture by several units.
    pub pictures: Vec<SweepPicture>,
    /// Units that failed.
    pub failed: Vec<FailedUnit>,
}

/// Units that differ in their seeds alone, with a camera where they make several.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SweepRow {
    /// The camera; empty where a unit makes none.
    pub camera: String,
    /// The values of the keys.
    pub values: Vec<String>,
    /// Number of units.
    pub units: usize,
    /// Every figure: its mean with its spread, and its range.
    pub figures: Vec<SweepFigure>,
    /// Which of the figures are the best of their column.
    pub best: Vec<bool>,
    /// What the job says of its result in words, such as the fate of a ray. The table has a column for it if a row has any.
    pub status: String,
}

/// A figure of a row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SweepFigure {
    /// The mean, with the standard deviation over the seeds where there are several; a dash where there is none.
    pub mean: String,
    /// The least and the largest value; empty where there is one.
    pub range: String,
}

/// A picture by a unit.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepPicture {
    /// The unit, and the camera where it makes several.
    pub label: String,
    /// What is known of it: scores.
    pub remark: String,
    /// The picture, a PNG file.
    pub png: Vec<u8>,
}

/// A unit that failed.
#[derive(Clone, Debug, PartialEq)]
pub struct FailedUnit {
    /// Its name.
    pub name: String,
    /// Why it failed.
    pub error: String,
    /// The command that runs it again.
    pub again: String,
}

/// The page.
pub fn page(sweep: &SweepView) -> String {
    let mut sections: Vec<Section> = vec![section("Results", table(sweep))];
    sections.extend(sweep.scatter.as_ref().map(|scatter| section("Scatter plot", figure(&scatter.svg()))));
    if !sweep.pictures.is_empty() {
        sections.push(section("Pictures", pictures(&sweep.pictures)));
    }
    if !sweep.failed.is_empty() {
        sections.push(section("Failed units", failed(&sweep.failed)));
    }
    Page {
        title: sweep.title.clone(),
        style: include_str!("page.css"),
        headline: sweep.title.clone(),
        subtitle: html! { (sweep.subtitle) },
        lead: html! { @if let Some(answer) = &sweep.answer { p.lead { (answer) } } },
        main: with_contents(&sections),
        ..Page::default()
    }
    .html()
}

/// The keys first, then the figures with their ranges below them.
fn table(sweep: &SweepView) -> Markup {
    if sweep.rows.is_empty() {
        return html! { p { "No unit has finished yet." } };
    }
    let has_cameras = sweep.rows.iter().any(|row| !row.camera.is_empty());
    let camera = has_cameras.then(|| Column::new("camera").text());
    let keys = sweep.keys.iter().map(|key| Column::new(html! { code { (key) } }).text());
    let figures = sweep.figures.iter().map(|(name, unit)| Column::new(name).unit(unit));
    let mut columns: Vec<Column> = camera.into_iter().chain(keys).collect();
    if columns.is_empty() {
        columns.push(Column::new("").text());
    }
    columns.push(Column::new("units"));
    columns.extend(figures);
    let has_status = sweep.rows.iter().any(|row| !row.status.is_empty());
    columns.extend(has_status.then(|| Column::new("status").note()));
    let rows = sweep.rows.iter().map(|row| {
        let camera = has_cameras.then(|| html! { (row.camera) });
        let values = row.values.iter().map(|value| html! { (value) });
        let mut cells: Vec<Markup> = camera.into_iter().chain(values).collect();
        if cells.is_empty() {
            cells.push(html! {});
        }
        cells.push(html! { (row.units) });
        cells.extend(row.figures.iter().enumerate().map(|(i, of)| {
            let is_best = row.best.get(i).copied().unwrap_or(false);
            html! {
                @if is_best { strong { (of.mean) } } @else { (of.mean) }
                @if !of.range.is_empty() { span.range { (of.range) } }
            }
        }));
        cells.extend(has_status.then(|| html! { (row.status) }));
        Row::new(cells.remove(0), cells)
    });
    html! {
        (Table::new(columns).rows(rows).html())
        @if !sweep.constant.is_empty() {
            @let same: Vec<String> = sweep.constant.iter().map(|(name, value)| format!("{name} {value}")).collect();
            p.caption { "The same in every unit: " (same.join(", ")) "." }
        }
        (caption("Mean over the seeds ± standard deviation; below it the least and the largest value. The best mean of a score is bold."))
    }
}

fn pictures(all: &[SweepPicture]) -> Markup {
    html! {
        div.views {
            @for picture in all {
                figure class="picture" {
                    img src=(png::address(&picture.png)) alt=(format!("Picture by {}", picture.label)) loading="lazy";
                    figcaption { strong { (picture.label) } @if !picture.remark.is_empty() { br; (picture.remark) } }
                }
            }
        }
        (caption("The same held-out picture, finished, by the first seed of every row."))
    }
}

fn failed(all: &[FailedUnit]) -> Markup {
    let columns = [Column::new("unit").text(), Column::new("error").note(), Column::new("run again").note()];
    let rows = all.iter().map(|unit| {
        Row::new(html! { code { (unit.name) } }, [html! { (unit.error) }, html! { code { (unit.again) } }])
    });
    Table::new(columns).rows(rows).html()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep() -> SweepView {
        let figure = |mean: &str, range: &str| SweepFigure { mean: mean.into(), range: range.into() };
        let row = |grid: &str, mean: &str, is_best: bool| SweepRow {
            camera: "end-to-end".into(),
            values: vec![grid.into()],
            units: 2,
            figures: vec![figure(mean, "27.0 to 27.4"), figure("-", "")],
            best: vec![is_best, false],
            status: if is_best { "ok".into() } else { "missed surface 3".into() },
        };
        SweepView {
            title: "A <sweep>".into(),
            subtitle: "4 of 5 units are finished.".into(),
            answer: Some("PSNR from 26.9 to 27.2 dB; best: psf.grid_cells 64.".into()),
            constant: vec![("focal length".into(), "50".into()), ("trials".into(), "20".into())],
            keys: vec!["psf.grid_cells".into()],
            figures: vec![("PSNR".into(), "dB".into()), ("RMS spot".into(), "µm".into())],
            rows: vec![row("64", "27.2 ± 0.2", true), row("128", "26.9 ± 0.1", false)],
            scatter: Some(Scatter {
                names: ["key psf.grid cells".into(), "PSNR, dB".into()],
                x_words: Vec::new(),
                groups: vec![ScatterGroup {
                    name: "end-to-end".into(),
                    at: vec![[64.0, 27.0], [128.0, 26.9]],
                }],
            }),
            pictures: vec![SweepPicture {
                label: "grid=64".into(),
                remark: "27.20 dB".into(),
                png: vec![1, 2],
            }],
            failed: vec![FailedUnit {
                name: "grid=32".into(),
                error: "no light <b>".into(),
                again: "petzval sweep x".into(),
            }],
        }
    }

    #[test]
    fn the_page_has_a_row_for_every_combination_its_plot_pictures_and_failures() {
        let page = page(&sweep());
        crate::page::assert_readable(&page);
        for words in [
            "<h1>A &lt;sweep&gt;</h1>",
            "<p class=\"lead\">PSNR from 26.9 to 27.2 dB; best: psf.grid_cells 64.</p>",
            "The same in every unit: focal length 50, trials 20.",
            "<div class=\"scroll\"><table",
            "<code>psf.grid_cells</code>",
            "<strong>27.2 ± 0.2</strong>",
            "27.0 to 27.4",
            "missed surface 3",
            "class=\"points\"",
            "grid=64",
            "no light &lt;b&gt;",
            "petzval sweep x",
            "data:image/png",
        ] {
            assert!(page.contains(words), "{words}");
        }
        assert!(!page.contains("NaN"));
    }

    #[test]
    fn a_sweep_without_a_finished_unit_says_so() {
        let none = page(&SweepView { title: "A".into(), ..SweepView::default() });
        assert!(none.contains("No unit has finished yet.") && !none.contains("<table"));
    }
}
