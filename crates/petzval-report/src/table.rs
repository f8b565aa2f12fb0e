//! Tables of all pages: columns with a name and a unit, rows with a head.

use maud::{Markup, Render, html};

use crate::palette;

/// A column.
#[derive(Clone, Debug)]
pub(crate) struct Column {
    name: Markup,
    unit: Markup,
    kind: Kind,
}

/// Content of a column, which determines the style of its cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Numbers: aligned right, so that their digits are below each other.
    Number,
    /// Names: to the left.
    Text,
    /// Explanations: to the left, subdued, over several lines where they are long.
    Note,
    /// Units: to the left and subdued.
    Unit,
}

impl Column {
    /// A column of numbers.
    pub fn new(name: impl Render) -> Self {
        Self { name: name.render(), unit: Markup::default(), kind: Kind::Number }
    }

    /// Adds a unit, or another explanation of the numbers, below the name.
    pub fn unit(self, unit: impl Render) -> Self {
        Self { unit: unit.render(), ..self }
    }

    /// A column of names.
    pub fn text(self) -> Self {
        Self { kind: Kind::Text, ..self }
    }

    /// A column of explanations.
    pub fn note(self) -> Self {
        Self { kind: Kind::Note, ..self }
    }

    /// A column of units.
    pub fn units(self) -> Self {
        Self { kind: Kind::Unit, ..self }
    }

    /// The class of the cells; numbers have none.
    fn class(&self) -> Option<&'static str> {
        match self.kind {
            Kind::Number => None,
            Kind::Text => Some("text-cell"),
            Kind::Note => Some("note-cell"),
            Kind::Unit => Some("unit-cell"),
        }
    }
}

/// A row.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    head: Markup,
    cells: Vec<Markup>,
    class: Option<&'static str>,
    style: Option<String>,
}

impl Row {
    /// A row with its head, and one cell for each other column.
    pub fn new<C: Render>(head: impl Render, cells: impl IntoIterator<Item = C>) -> Self {
        let cells = cells.into_iter().map(|cell| cell.render()).collect();
        Self { head: head.render(), cells, class: None, style: None }
    }

    /// Sets the CSS class.
    pub fn class(self, class: &'static str) -> Self {
        Self { class: Some(class), ..self }
    }

    /// Adds the colour of a camera in front of the head.
    pub fn of_camera(self, colour: &str) -> Self {
        Self { style: Some(palette::camera_style(colour)), ..self }
    }
}

/// A table.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    class: Option<&'static str>,
    groups: Vec<(&'static str, usize)>,
    columns: Vec<Column>,
    rows: Vec<Row>,
}

impl Table {
    /// An empty table; the first column holds the heads of the rows.
    pub fn new(columns: impl IntoIterator<Item = Column>) -> Self {
        Self { class: None, groups: Vec::new(), columns: columns.into_iter().collect(), rows: Vec::new() }
    }

    /// Sets the CSS class.
    pub fn class(self, class: &'static str) -> Self {
        Self { class: Some(class), ..self }
    }

    /// Adds names above groups of columns, with the number of columns of each, from the second column on.
    pub fn groups(self, groups: impl IntoIterator<Item = (&'static str, usize)>) -> Self {
        Self { groups: groups.into_iter().collect(), ..self }
    }

    /// Adds rows.
    pub fn rows(mut self, rows: impl IntoIterator<Item = Row>) -> Self {
        self.rows.extend(rows);
        self
    }

    /// The table as HTML; one that is too wide for the page scrolls.
    pub fn html(&self) -> Markup {
        html! {
            div.scroll {
                table class=[self.class] {
                    thead { (self.group_heads()) (self.heads()) }
                    tbody { @for row in &self.rows { (self.row(row)) } }
                }
            }
        }
    }

    fn group_heads(&self) -> Markup {
        html! {
            @if !self.groups.is_empty() {
                tr { th {} @for (name, columns) in &self.groups { th colspan=(columns) scope="colgroup" { (name) } } }
            }
        }
    }

    fn heads(&self) -> Markup {
        let has_units = self.columns.iter().any(|c| !c.unit.0.is_empty());
        html! {
            tr {
                @for (i, column) in self.columns.iter().enumerate() {
                    th class=[column.class()] scope="col" {
                        (column.name)
                        @if !column.unit.0.is_empty() { span.unit { (column.unit) } }
                        // Names stand on one line, also those without a unit below.
                        @else if has_units && i > 0 { span.unit { "\u{a0}" } }
                    }
                }
            }
        }
    }

    fn row(&self, row: &Row) -> Markup {
        html! {
            tr class=[row.class] {
                th scope="row" style=[row.style.as_ref()] { (row.head) }
                @for (column, cell) in self.columns[1..].iter().zip(&row.cells) {
                    td class=[column.class()] { (cell) }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_units_and_kinds_show() {
        let table = Table::new([
            Column::new("lens"),
            Column::new("radius").unit("mm"),
            Column::new("glass <n>").text(),
        ])
        .rows([Row::new("front", ["1.0", "<air>"]), Row::new("rear", ["2.0", ""]).class("sum")])
        .html()
        .into_string();
        assert!(table.contains("radius<span class=\"unit\">mm</span>"), "{table}");
        assert!(
            table.contains("<td class=\"text-cell\">&lt;air&gt;</td>") && table.contains("glass &lt;n&gt;")
        );
        assert!(table.contains("<tr><th scope=\"row\">front</th><td>1.0</td>"));
        assert!(table.contains("<tr class=\"sum\">"));
        // The glass has no unit, and its name stands beside the others.
        assert_eq!(table.matches("class=\"unit\"").count(), 2);
    }

    #[test]
    fn groups_stand_above_their_columns() {
        let columns = ["position", "R", "G", "B"].map(Column::new);
        let table = Table::new(columns).groups([("noise", 3)]).html().into_string();
        assert!(table.contains("<th colspan=\"3\" scope=\"colgroup\">noise</th>"), "{table}");
        assert!(!table.contains("unit"));
    }
}
