//! Shares of a gap: how much of the way from the first camera of a table to perfect optics each camera goes, in percent.

use super::data::{Table, name_of};
use super::figure::Figure;

/// How the name of the row of perfect optics begins.
const CEILING: &str = "perfect";

/// How far a share may lie from what follows from the means of its table, which are rounded themselves.
const ROUNDED: f64 = 1.01;

impl Table {
    /// Fills all columns that state a gap.
    pub(super) fn fill_gaps(&mut self) {
        for (row, column, share) in self.gaps() {
            self.rows[row][column] = Some(Figure::Number(share));
        }
    }

    /// A share that does not follow from the scores of its table, if there is one.
    pub(super) fn gap_problem(&self) -> Option<String> {
        let other = self.gaps().into_iter().find(|(row, column, share)| {
            let stated = self.rows[*row][*column].as_ref().and_then(Figure::value);
            stated.is_some_and(|stated| (stated - share).abs() > ROUNDED)
        });
        other.map(|(row, column, share)| {
            let (camera, column) = (name_of(&self.rows[row]).unwrap_or_default(), &self.columns[column].name);
            format!("table {:?}: {camera}, {column}: from its scores follows {share}", self.key)
        })
    }

    /// Row, column and whole percent of every share that the scores give.
    fn gaps(&self) -> Vec<(usize, usize, f64)> {
        let Some(ceiling) =
            self.rows.iter().position(|row| name_of(row).is_some_and(|name| name.starts_with(CEILING)))
        else {
            return Vec::new();
        };
        let mut shares = Vec::new();
        for (column, about) in self.columns.iter().enumerate() {
            let Some(score) = self.columns.iter().position(|known| about.gap.as_ref() == Some(&known.name))
            else {
                continue;
            };
            let score = |row: usize| self.rows[row][score].as_ref().and_then(Figure::value);
            let (Some(start), Some(end)) = (score(0), score(ceiling)) else { continue };
            for row in (1..self.rows.len()).filter(|row| *row != ceiling) {
                if let Some(value) = score(row) {
                    shares.push((row, column, (100.0 * (value - start) / (end - start)).round()));
                }
            }
        }
        shares
    }
}

#[cfg(test)]
mod tests {
    use crate::results::data::DataFile;

    #[test]
    fn a_share_that_does_not_follow_from_its_table_is_named() {
        let with = |share: &str| {
            let text = format!(
                r#"{{"tables": [{{"key": "low", "title": "t", "command": "c", "version": "0.1.0", "date": "2026-01-01", "origin": "o",
                "columns": [{{"name": "camera"}}, {{"name": "PSNR", "decimals": 2}}, {{"name": "closed", "gap": "PSNR"}}],
                "rows": [["nominal", 24.58, null], ["spot", 25.02, {share}], ["perfect", 26.69, null]]}}]}}"#
            );
            DataFile::parse(&text).err()
        };
        assert_eq!(with("21"), None);
        // Means are rounded before the share is taken.
        assert_eq!(with("22"), None);
        assert_eq!(with("null"), None);
        let problem = with("28").unwrap_or_default();
        assert!(problem.contains("spot, closed: from its scores follows 21"), "{problem}");
    }
}
