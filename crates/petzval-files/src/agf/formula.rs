//! The formulas of AGF files.

use petzval_optics::glass::Dispersion;

/// Number of coefficients of each formula.
pub(super) const COUNTS: [usize; 13] = [6, 6, 6, 5, 3, 8, 4, 4, 5, 8, 10, 8, 9];

/// A formula by its number; `a` has as many coefficients as that formula. `None` if the formula would have no term.
pub(super) fn dispersion(formula: usize, a: &[f64]) -> Option<Dispersion> {
    let schott_powers = [0.0, 2.0, -2.0, -4.0, -6.0, -8.0];
    let series = |powers: &[f64]| {
        let rows = a.iter().zip(powers).map(|(a, p)| [*a, *p]);
        Dispersion::Square { powers: rows.filter(|[a, _]| *a != 0.0).collect(), resonances: Vec::new() }
    };
    let square = |powers: &[[f64; 2]], resonances: &[[f64; 4]]| Dispersion::Square {
        powers: powers.iter().copied().filter(|[a, _]| *a != 0.0).collect(),
        resonances: resonances.iter().copied().filter(|[b, ..]| *b != 0.0).collect(),
    };
    let found = match (formula, a) {
        (1, &[a0, a1, a2, a3, a4, a5]) => Dispersion::Schott([a0, a1, a2, a3, a4, a5]),
        (3, &[a0, a1, a2, a3, a4, a5]) => Dispersion::Herzberger([a0, a1, a2, a3, a4, a5]),
        (4, &[a, b1, w1, b2, w2]) => {
            square(&[[1.0, 0.0], [a, 0.0]], &[[b1, 2.0, w1, 2.0], [b2, 0.0, w2, 2.0]])
        }
        (5, &[n0, a, b]) => Dispersion::Powers(vec![[n0, 0.0], [a, -1.0], [b, -3.5]]),
        (7, &[a, b, c, d]) => square(&[[a, 0.0], [-d, 2.0]], &[[b, 0.0, c, 1.0]]),
        (8, &[a, b, c, d]) => square(&[[a, 0.0], [-d, 2.0]], &[[b, 2.0, c, 1.0]]),
        (9, &[a, b, c, d, e]) => square(&[[a, 0.0]], &[[b, 2.0, c, 1.0], [d, 2.0, e, 1.0]]),
        (10, _) => series(&[&schott_powers[..], &[-10.0, -12.0]].concat()),
        (12, _) => series(&[&schott_powers[..], &[4.0, 6.0]].concat()),
        (13, _) => series(&[0.0, 2.0, 4.0, -2.0, -4.0, -6.0, -8.0, -10.0, -12.0]),
        _ => {
            let pairs = a.chunks_exact(2).filter(|pair| pair[0] != 0.0);
            let (b, c_um2) = pairs.map(|pair| (pair[0], pair[1])).unzip();
            Dispersion::Sellmeier { b, c_um2 }
        }
    };
    let has_terms = match &found {
        Dispersion::Sellmeier { b, .. } => !b.is_empty(),
        Dispersion::Square { powers, resonances } => !(powers.is_empty() && resonances.is_empty()),
        _ => a.iter().any(|a| *a != 0.0),
    };
    has_terms.then_some(found)
}
