//! Prints the pages of the manual that compare Petzval with Optiland and ray-optics: the comparison, or its values lens by lens, with the word
//! `samples` for Optiland's samples and with `built-in` for the built-in lenses.
//!
//! `cargo run --release -p petzval-files --example program_comparison > book/src/results/comparison.md`

mod checks;
mod listed;
mod ours;
mod rows;

use std::fmt::Write;

use checks::{Check, Settling};
use rows::{Compared, Pair, Row};

/// The page with placeholders for its tables.
const PAGE: &str = include_str!("page.md");

/// The page of all values for Optiland's samples.
const PAGE_OF_SAMPLES: &str = include_str!("lenses.md");

/// The page of all values for built-in lenses.
const PAGE_OF_BUILT_IN: &str = include_str!("built_in.md");

fn main() {
    let listed = listed::listed();
    let lenses = rows::compare(&listed);
    let page_of_values = match std::env::args().nth(1).as_deref() {
        Some("samples") => Some((PAGE_OF_SAMPLES, false)),
        Some("built-in") => Some((PAGE_OF_BUILT_IN, true)),
        _ => None,
    };
    if let Some((page, is_built_in)) = page_of_values {
        let shown = lenses.iter().filter(|lens| lens.file.is_some() == is_built_in);
        let tables: String = shown.map(lens_text).collect();
        print!("{}", page.replace("{lenses}\n", &tables));
        return;
    }
    let of_note = |note: &str, checks: &[Check]| checks_text(checks.iter().filter(|c| c.note == note));
    let checks = checks::checks(&listed);
    let mut page = PAGE
        .replace("{summary}\n", &summary_text(&lenses))
        .replace("{settling}\n", &settling_text(&checks::settling(&listed)))
        .replace("{tolerance}\n", &tolerance_text(&listed))
        .replace("{coddington}\n", &coddington_text(&listed));
    for note in ["a", "b", "c", "d", "far"] {
        page = page.replace(&format!("{{check {note}}}\n"), &of_note(note, &checks));
    }
    print!("{page}");
}

/// The largest difference among pairs that should agree.
fn difference<'a>(pairs: impl Iterator<Item = &'a Pair>) -> Option<f64> {
    pairs.filter(|p| p.because.is_none()).map(|p| (p.ours - p.theirs).abs()).reduce(f64::max)
}

/// A difference to one digit. Differences at the level of rounding are not resolved.
fn apart(difference: Option<f64>) -> String {
    match difference {
        None => "-".into(),
        Some(d) if d < 1e-12 => "< 1e-12".into(),
        Some(d) => format!("{d:.0e}"),
    }
}

fn theirs(row: &Row, pair: &Pair) -> String {
    let mark = pair.because.map_or(String::new(), |b| format!(" ({})", b.mark()));
    format!("{:.*}{mark}", row.digits, pair.theirs)
}

fn first_order_text(rows: &[Row]) -> String {
    let mut text = String::from(
        "| quantity | unit | Petzval | Optiland | ray-optics | largest difference |\n|---|---|---|---|---|---|\n",
    );
    for row in rows {
        let cells: Vec<String> =
            row.pairs.iter().map(|p| p.map_or("-".into(), |p| theirs(row, &p))).collect();
        let largest = apart(difference(row.pairs.iter().flatten()));
        let _ = writeln!(
            text,
            "| {} | {} | {:.*} | {} | {largest} |",
            row.quantity,
            row.unit,
            row.digits,
            row.own,
            cells.join(" | "),
        );
    }
    text
}

fn rays_text(fields: &[(f64, Vec<Row>)]) -> String {
    let mut text = String::from(
        "| field, degrees | quantity | unit | Petzval | Petzval (P) | Optiland (P) | Petzval (M) | ray-optics (M) | Petzval (T) | Optiland (T) \
         | largest difference of two alike |\n|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (field, rows) in fields {
        for row in rows {
            let cells: Vec<String> = (row.pairs.iter().flatten())
                .map(|p| format!("{:.*} | {}", row.digits, p.ours, theirs(row, p)))
                .collect();
            let largest = apart(difference(row.pairs.iter().flatten()));
            let _ = writeln!(
                text,
                "| {field} | {} | {} | {:.*} | {} | {largest} |",
                row.quantity,
                row.unit,
                row.digits,
                row.own,
                cells.join(" | "),
            );
        }
    }
    text
}

fn modulation_text(lens: &Compared) -> String {
    let mut text = String::from(
        "| field, degrees | section | by | Petzval | Petzval (P) | Optiland (P) | largest difference of two alike |\n|---|---|---|---|---|---|---|\n",
    );
    let four = |values: &mut dyn Iterator<Item = f64>| -> String {
        values.map(|v| format!("{v:.3}")).collect::<Vec<_>>().join(" ")
    };
    for row in &lens.modulation {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} |",
            row.field_deg,
            row.section,
            row.by,
            four(&mut row.own.iter().copied()),
            four(&mut row.pairs.iter().map(|p| p.ours)),
            four(&mut row.pairs.iter().map(|p| p.theirs)),
            apart(difference(row.pairs.iter())),
        );
    }
    text
}

fn lens_text(lens: &Compared) -> String {
    let built_in = lens.file.as_ref().map_or(String::new(), |file| format!(" (`{file}`)"));
    format!(
        "### {}{built_in}\n\n{}\n{}\nModulation at 10, 20, 30 and 50 cycles/mm:\n\n{}\n",
        lens.name,
        first_order_text(&lens.first_order),
        rays_text(&lens.rays),
        modulation_text(lens)
    )
}

/// A row of the summary: one quantity.
#[derive(Default)]
struct Summed {
    quantity: String,
    unit: &'static str,
    /// Largest difference from Optiland and from ray-optics, each with the largest tolerance of its tests.
    from: [(Option<f64>, f64); 2],
}

/// The largest difference of each quantity over all lenses and fields.
fn summary_text(lenses: &[Compared]) -> String {
    let mut found: Vec<Summed> = Vec::new();
    let mut add = |quantity: &str, unit, of: [Vec<Pair>; 2]| {
        let at = found.iter().position(|row| row.quantity == quantity).unwrap_or_else(|| {
            found.push(Summed { quantity: quantity.into(), unit, ..Summed::default() });
            found.len() - 1
        });
        for ((largest, allowed), pairs) in found[at].from.iter_mut().zip(of) {
            *largest = (*largest).into_iter().chain(difference(pairs.iter())).reduce(f64::max);
            let counted = pairs.iter().filter(|p| p.because.is_none());
            *allowed = counted.map(|p| p.tolerance).fold(*allowed, f64::max);
        }
    };
    for lens in lenses {
        for row in &lens.first_order {
            add(&row.quantity, row.unit, [0, 1].map(|k| row.pairs[k].into_iter().collect()));
        }
    }
    for row in lenses.iter().flat_map(|lens| lens.rays.iter().flat_map(|(_, rows)| rows)) {
        let of = |which: &[usize]| which.iter().filter_map(|k| row.pairs[*k]).collect();
        add(&row.quantity, row.unit, [of(&[0, 2]), of(&[1])]);
    }
    for row in lenses.iter().flat_map(|lens| &lens.modulation) {
        add(&format!("modulation by {}", row.by), "", [row.pairs.clone(), Vec::new()]);
    }
    let mut text = String::from(
        "| quantity | unit | from Optiland | tested to | from ray-optics | tested to |\n|---|---|---|---|---|---|\n",
    );
    for row in found {
        let cells = row.from.map(|(largest, allowed)| match largest {
            Some(_) => format!("{} | {allowed:.0e}", apart(largest)),
            None => "- | -".into(),
        });
        let _ = writeln!(text, "| {} | {} | {} |", row.quantity, row.unit, cells.join(" | "));
    }
    text
}

fn checks_text<'a>(checks: impl Iterator<Item = &'a Check>) -> String {
    let mut text = String::from(
        "| lens | one value | | another | | difference | tested to |\n|---|---|---|---|---|---|---|\n",
    );
    for c in checks {
        let largest = apart(Some((c.value - c.other).abs()));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {largest} | {:.0e} |",
            c.lens,
            c.this,
            number(c.value),
            c.that,
            number(c.other),
            c.tolerance
        );
    }
    text
}

/// A number with eight decimals, or with an exponent if it is below 1e-3.
fn number(value: f64) -> String {
    if value.abs() < 1e-3 { format!("{value:.3e}") } else { format!("{value:.8}") }
}

fn settling_text(lenses: &[Settling]) -> String {
    let mut text = String::from("| lens |");
    for (rays, _) in &lenses[0].by_rays {
        let _ = write!(text, " {rays} rays a side |");
    }
    text += &format!("\n|---|{}\n", "---|".repeat(lenses[0].by_rays.len()));
    for lens in lenses {
        let cells: Vec<String> = lens.by_rays.iter().map(|(_, d)| format!("{d:.5}")).collect();
        let _ = writeln!(text, "| {} | {} |", lens.lens, cells.join(" | "));
    }
    text
}

fn tolerance_text(listed: &listed::Listed) -> String {
    let mut text = String::from(
        "| lens | field, degrees | Petzval | Optiland, 1e-14 | Optiland, 1e-6 |\n|---|---|---|---|---|\n",
    );
    for lens in listed.lenses.iter().filter(|l| l.surfaces.iter().any(|s| s.asphere_from_r2.is_some())) {
        let studied = ours::Studied::new(lens, listed.near_axis_height);
        for (i, field) in lens.fields_deg.iter().enumerate() {
            let ours = studied.at_field(*field, ours::Aim::Paraxial, None).opd_rms_waves;
            let (tight, loose) =
                (lens.optiland.paraxial_aim[i].opd_rms_waves, lens.optiland.opd_rms_waves_as_it_comes[i]);
            let _ = writeln!(text, "| {} | {field} | {ours:.8} | {tight:.8} | {loose:.8} |", lens.name);
        }
    }
    text
}

fn coddington_text(listed: &listed::Listed) -> String {
    let mut text = String::from(
        "| lens | field, degrees | S and T by close rays, mm | S and T by its Coddington trace, mm |\n|---|---|---|---|\n",
    );
    for lens in &listed.lenses {
        if let Some(f) = lens.rayoptics.shifted_aim.last() {
            let [s, t] = f.coddington_mm.unwrap_or([f64::NAN; 2]);
            let (a, b) = (f.sagittal_focus_mm, f.tangential_focus_mm);
            let _ = writeln!(
                text,
                "| {} | {} | {a:.5}, {b:.5} | {s:.5}, {t:.5} |",
                lens.name,
                lens.fields_deg.last().copied().unwrap_or(0.0)
            );
        }
    }
    text
}
