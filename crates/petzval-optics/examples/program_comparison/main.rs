//! Prints the page of the manual that sets Petzval's numbers beside those of Optiland and ray-optics.
//!
//! `cargo run --release -p petzval-optics --example program_comparison > book/src/comparison.md`

mod listed;
mod ours;
mod rows;

use rows::{Compared, Pair, Row};

fn main() {
    let listed = listed::listed();
    for lens in rows::compare(&listed) {
        println!("{}", tables(&lens));
    }
}

fn difference(pairs: &[Pair]) -> f64 {
    pairs.iter().filter(|p| p.because.is_none()).map(|p| (p.ours - p.theirs).abs()).fold(0.0, f64::max)
}

fn row_text(row: &Row) -> String {
    let pairs: Vec<Pair> = row.pairs.iter().flatten().copied().collect();
    let cells: Vec<String> = row.pairs.iter().map(|p| p.map_or("-".into(), |p| format!("{:.*} | {:.*}", row.digits, p.ours, row.digits, p.theirs))).collect();
    format!("| {} | {} | {} | {:.1e} |", row.quantity, row.unit, cells.join(" | "), difference(&pairs))
}

fn tables(lens: &Compared) -> String {
    let mut text = format!("### {}\n", lens.name);
    for row in &lens.first_order { text += &(row_text(row) + "\n"); }
    for (field, rows) in &lens.rays { text += &format!("field {field}\n"); for row in rows { text += &(row_text(row) + "\n"); } }
    for m in &lens.modulation {
        text += &format!("{} {} {} {:.4?} | {:.4?} | {:.4?} | {:.1e}\n", m.field_deg, m.section, m.by, m.own, m.pairs.iter().map(|p| p.ours).collect::<Vec<_>>(), m.pairs.iter().map(|p| p.theirs).collect::<Vec<_>>(), difference(&m.pairs));
    }
    text
}
