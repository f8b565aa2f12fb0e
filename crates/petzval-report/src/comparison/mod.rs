//! Runs on one page: tables with means over the seeds, lenses, curves, and the same pictures by every camera.

use maud::{Markup, html};

use crate::design_report::{Report, lenses, over_the_field, over_the_run, pictures};
use crate::page::{Page, Section, caption, section, with_contents};
use crate::table::{Column, Row, Table};

/// Runs of one experiment.
#[derive(Clone, Debug, Default)]
pub struct Group {
    /// Title of the experiment.
    pub title: String,
    /// What came out, in one sentence; none where one camera stands alone.
    pub answer: Option<String>,
    /// Seeds, steps, time and memory, in words.
    pub subtitle: String,
    /// Tables of text: each with a caption, heads of columns and rows.
    pub tables: Vec<TextTable>,
    /// The report of its first run; pictures beyond [`SHOWN`] are left out.
    pub report: Report,
}

/// A table of finished cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TextTable {
    /// Caption: what the table shows.
    pub caption: String,
    /// Heads of the columns. The first column holds the heads of the rows.
    pub head: Vec<String>,
    /// The rows. The first cell of each is its head.
    pub rows: Vec<Vec<String>>,
}

/// Held-out pictures that each experiment shows.
pub const SHOWN: usize = 3;

impl TextTable {
    /// The table in Markdown, with its caption above it.
    pub fn markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let mut text = format!("{}\n\n{}|", self.caption, line(&self.head));
        text += &"---|".repeat(self.head.len());
        text.push('\n');
        self.rows.iter().for_each(|row| text += &line(row));
        text
    }

    fn html(&self) -> Markup {
        let columns = self.head.iter().map(Column::new);
        let rows = self.rows.iter().filter_map(|row| {
            let (head, cells) = row.split_first()?;
            Some(Row::new(head, cells))
        });
        html! {
            (Table::new(columns).rows(rows).html())
            (caption(&self.caption))
        }
    }
}

/// The page. `differences`: what differs between the groups, if there are several.
pub fn page(differences: Option<&TextTable>, groups: &[Group]) -> String {
    let above = differences.map(|table| section("What differs", table.html()));
    let groups = groups.iter().map(|group| section(&group.title, of_group(group)));
    let sections: Vec<Section> = above.into_iter().chain(groups).collect();
    Page {
        title: "Runs compared".to_owned(),
        style: include_str!("../design_report/page.css"),
        headline: "Runs compared".to_owned(),
        subtitle: html! {
            "Every score is that of exact optics and the real ISP on held-out pictures. ± is the standard deviation over the seeds; "
            "figures of one seed have none."
        },
        main: with_contents(&sections),
        ..Page::default()
    }
    .html()
}

fn of_group(group: &Group) -> Markup {
    let report = &group.report;
    html! {
        @if let Some(answer) = &group.answer { p.lead.answer { (answer) } }
        p.muted { (group.subtitle) }
        @for table in &group.tables { (table.html()) }
        @if !report.pictures.is_empty() {
            details open { summary { "Pictures" } (pictures(report)) }
        }
        @if !report.cameras.is_empty() {
            details { summary { "Lenses" } (lenses(report)) }
            details { summary { "Over the field" } (over_the_field(report)) }
        }
        @if !report.losses.is_empty() {
            details { summary { "Over the run" } (over_the_run(report)) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    fn group() -> Group {
        Group {
            title: "A <test>".into(),
            answer: Some("End-to-end is ahead.".into()),
            subtitle: "3 seeds".into(),
            tables: vec![TextTable {
                caption: "Scores.".into(),
                head: vec!["camera".into(), "PSNR".into()],
                rows: vec![vec!["nominal".into(), "27.1 ± 0.2".into()]],
            }],
            report: sample::report(),
        }
    }

    #[test]
    fn the_page_shows_every_group_with_its_tables_and_pictures() {
        let table = TextTable { head: vec!["experiment".into(), "psf.grid".into()], ..TextTable::default() };
        let page = page(Some(&table), &[group(), Group { title: "Other".into(), ..Group::default() }]);
        crate::page::assert_readable(&page);
        for words in [
            "<h2>A &lt;test&gt;</h2>",
            "End-to-end is ahead.",
            "<h2>Other</h2>",
            "27.1 ± 0.2",
            "Lenses",
            "Over the run",
            "psf.grid",
        ] {
            assert!(page.contains(words), "{words}");
        }
        assert!(!page.contains("NaN"));
    }

    #[test]
    fn markdown_has_a_line_for_each_row() {
        let text = group().tables[0].markdown();
        assert_eq!(text, "Scores.\n\n| camera | PSNR |\n|---|---|\n| nominal | 27.1 ± 0.2 |\n");
    }
}
