//! Changes: the numbers of a lens before and after, and their positions between the bounds.

use maud::{Markup, html};

use super::view::Change;
use crate::number;
use crate::table::{Column, Row, Table};

/// Values nearer to a bound than this share of the range count as lying on it.
const ON_BOUND: f64 = 0.01;

/// The table of changes from the start, each under its name as `named` shows it; nothing if there are none.
pub(super) fn change_table(changes: &[Change], named: fn(&str) -> Markup) -> Markup {
    if changes.is_empty() {
        return html! {};
    }
    let columns = [
        Column::new("parameter"),
        Column::new("start"),
        Column::new("now"),
        Column::new("change"),
        Column::new("unit").units(),
        Column::new("between its bounds").text(),
    ];
    let rows = changes.iter().map(|change| {
        let cells = [
            html! { (number::significant(change.from)) },
            html! { (number::significant(change.to)) },
            html! { (percent(change)) },
            html! { (number::unit(&change.unit)) },
            range(change),
        ];
        Row::new(named(&change.parameter), cells)
    });
    Table::new(columns).class("changes").rows(rows).html()
}

/// The change in per cent of the old value; a dash if the old value is zero.
fn percent(change: &Change) -> String {
    let share = 100.0 * (change.to - change.from) / change.from.abs();
    if change.from == 0.0 || !share.is_finite() || share.abs() > 1e3 {
        number::fixed(f64::NAN, 0)
    } else {
        format!("{} %", number::signed(share, 1))
    }
}

/// A line from bound to bound, with a tick at the old value and a dot at the new one.
fn range(change: &Change) -> Markup {
    let width = change.max - change.min;
    if !(width > 0.0 && width.is_finite()) {
        return html! { span.muted { "not bounded" } };
    }
    let share = |value: f64| ((value - change.min) / width).clamp(0.0, 1.0);
    let (from, to) = (share(change.from), share(change.to));
    let is_on_bound = !(ON_BOUND..=1.0 - ON_BOUND).contains(&to);
    let (low, high) = (number::significant(change.min), number::significant(change.max));
    let place = number::fixed(100.0 * to, 0);
    let way = format!("left:{:.1}%;width:{:.1}%", 100.0 * from.min(to), 100.0 * (to - from).abs());
    html! {
        div.bounds title=(format!("{low} … {high}")) role="img"
            aria-label=(format!("at {place} % of the range from {low} to {high}")) {
            i.was style=(format!("left:{:.1}%", 100.0 * from)) {}
            i.way style=(way) {}
            i.is.on-bound[is_on_bound] style=(format!("left:{:.1}%", 100.0 * to)) {}
        }
        @if is_on_bound { span.bound-note { "on its bound" } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change_table(changes: &[Change]) -> Markup {
        super::change_table(changes, |name| html! { (name) })
    }

    fn change(from: f64, to: f64, min: f64, max: f64) -> Change {
        Change { parameter: "V1 <front>".into(), from, to, unit: "mm".into(), min, max }
    }

    #[test]
    fn values_lie_between_their_bounds() {
        let table = change_table(&[change(11.34, 12.0, 10.0, 14.0)]).into_string();
        assert!(table.contains("V1 &lt;front&gt;") && table.contains("11.340") && table.contains("+5.8 %"));
        assert!(table.contains("left:50.0%") && !table.contains("on its bound"));
        let asphere = Change { unit: "mm^-3".into(), ..change(1.0, 2.0, 0.0, 4.0) };
        assert!(change_table(&[asphere]).into_string().contains("mm⁻³"));
        let bound = change_table(&[change(11.0, 14.0, 10.0, 14.0)]).into_string();
        assert!(bound.contains("on its bound"));
    }

    #[test]
    fn missing_bounds_and_scales_are_shown_as_such() {
        let free = change_table(&[change(0.0, 1e-5, f64::NEG_INFINITY, f64::INFINITY)]).into_string();
        assert!(free.contains("not bounded") && free.contains("1.0000·10⁻⁵") && !free.contains("inf %"));
        assert!(change_table(&[]).into_string().is_empty());
    }
}
