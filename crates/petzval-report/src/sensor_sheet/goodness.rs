//! Whether the points of the fits lie on their models: one row for each kind of fit, and one for each that departs.

use maud::{Markup, html};
use petzval_lab::emva::{Characterization, NamedFit, Verdict, fits};

use crate::number;
use crate::page::caption;
use crate::table::{Column, Row, Table};

/// The table of all fits; nothing where none could be tested.
pub(super) fn table(all: &Characterization) -> Option<Markup> {
    let tested: Vec<NamedFit> =
        fits(all).into_iter().filter(|fit| fit.test.verdict != Verdict::Untested).collect();
    let alpha = tested.first()?.test.alpha;
    let mut names: Vec<&str> = Vec::new();
    for fit in &tested {
        if !names.contains(&fit.name) {
            names.push(fit.name);
        }
    }
    let mut rows = Vec::new();
    for name in names {
        let of_name: Vec<&NamedFit> = tested.iter().filter(|fit| fit.name == name).collect();
        let holds = of_name.iter().filter(|fit| fit.test.verdict == Verdict::Holds).count();
        let worst = of_name.iter().min_by(|a, b| a.test.p_value.total_cmp(&b.test.p_value));
        rows.extend(worst.map(|worst| row(name, worst, format!("{holds} of {} hold", of_name.len()))));
        let departs = of_name.iter().filter(|fit| fit.test.verdict != Verdict::Holds);
        rows.extend(
            departs.map(|fit| row(&format!("– {}", fit.place()), fit, fit.test.verdict.words().to_owned())),
        );
    }
    let columns = [
        Column::new("fit"),
        Column::new("χ²/ν"),
        Column::new("ν"),
        Column::new("curvature").unit("standard errors"),
        Column::new("error that the departure adds").unit("%"),
        Column::new("verdict").note(),
    ];
    Some(html! {
        (Table::new(columns).class("figures").rows(rows).html())
        (caption(html! {
            "Each fit is tested by chi-squared and by a quadratic term, at a level of " (format!("{alpha:e}")) ". The row of a fit shows the one that is least "
            "likely by chance. Where a fit departs, its standard errors contain by how much, or its numbers are withdrawn."
        }))
    })
}

fn row(head: &str, fit: &NamedFit, verdict: String) -> Row {
    let test = &fit.test;
    let curvature = test.curvature_sigmas.map_or("–".to_owned(), |sigmas| number::fixed(sigmas, 1));
    let share = match fit.model_share.filter(|share| *share > 0.0) {
        Some(share) => number::fixed(100.0 * share, 2),
        None => "–".to_owned(),
    };
    let cells =
        [number::fixed(test.reduced_chi2, 2), test.degrees_of_freedom.to_string(), curvature, share, verdict];
    Row::new(head, cells)
}
