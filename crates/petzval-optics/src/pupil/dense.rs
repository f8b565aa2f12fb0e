//! Evaluates pupil polynomials densely: row by row of the pupil, several points at a time.

use crate::powers::{Powers, powers_of};
use pulp::Simd;

use super::basis::{Parity, PupilBasis};
use super::map::{MapCotangent, MapTangent, PupilMap};
use super::polynomial::{PupilPolynomial, Sides};
use crate::lanes::{Lanes, MAX_LANES, width};
use crate::trace::soft_edge;

/// Rows of the half disk `p_x > 0`: strips of equal height, with points of equal area.
#[derive(Clone, Debug)]
pub(crate) struct PupilRows {
    pub rows: Vec<Row>,
    /// `p_y^j` of every row, `[j][row]`.
    powers: Vec<Vec<f64>>,
}

/// Points `((k + 1/2) step, p_y)`, k = 0..count.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub p_y: f64,
    pub count: usize,
    pub step: f64,
    /// Share of the disk's area that a point and its mirror image stand for.
    pub weight: f64,
}

/// Highest power of p_y in the table.
const MAX_POWER: usize = 20;

impl PupilRows {
    /// Divides the diameter into a number of rows; points along a row are about as far apart as the rows.
    pub fn new(rows: usize) -> Self {
        let height = 2.0 / rows as f64;
        let rows: Vec<Row> = (0..rows)
            .map(|r| {
                // Compute area and centroid of the half strip between two heights, from the integrals of sqrt(1 - y^2) and
                // y sqrt(1 - y^2).
                let (low, high) = (-1.0 + height * r as f64, -1.0 + height * (r + 1) as f64);
                let chord = |y: f64| (1.0 - y * y).max(0.0).sqrt();
                let primitive = |y: f64| 0.5 * (y * chord(y) + y.clamp(-1.0, 1.0).asin());
                let area = primitive(high) - primitive(low);
                let moment = (chord(low).powi(3) - chord(high).powi(3)) / 3.0;
                let reach = area / height;
                let count = (reach / height).ceil().max(1.0) as usize;
                Row {
                    p_y: moment / area,
                    count,
                    step: reach / count as f64,
                    weight: 2.0 * area / std::f64::consts::PI / count as f64,
                }
            })
            .collect();
        let of_rows: Vec<Powers> = rows.iter().map(|row| powers_of(row.p_y, MAX_POWER)).collect();
        let powers = (0..=MAX_POWER).map(|j| of_rows.iter().map(|row| row[j]).collect()).collect();
        Self { rows, powers }
    }

    /// Coefficients along each row of a polynomial with these powers.
    fn along_rows(&self, coefficients: &[f64], powers: &[(usize, usize)]) -> RowTable {
        let terms = powers.last().map_or(0, |(i, _)| i / 2 + 1);
        let mut values = vec![0.0; terms * self.rows.len()];
        for (c, (i, j)) in coefficients.iter().zip(powers) {
            let along = &mut values[i / 2 * self.rows.len()..][..self.rows.len()];
            for (value, power) in along.iter_mut().zip(&self.powers[*j]) {
                *value += c * power;
            }
        }
        RowTable { terms, rows: self.rows.len(), values }
    }

    /// The transpose of [`PupilRows::along_rows`]: adds the cotangents of the coefficients.
    fn pull_back(&self, table: &RowTable, powers: &[(usize, usize)], coefficients_bar: &mut [f64]) {
        for (c, (i, j)) in coefficients_bar.iter_mut().zip(powers) {
            let along = &table.values[i / 2 * table.rows..][..table.rows];
            *c += along.iter().zip(&self.powers[*j]).map(|(value, power)| value * power).sum::<f64>();
        }
    }
}

/// Coefficients of `p_x^(2k)` (or `p_x^(2k+1)`) along each row.
#[derive(Clone, Debug)]
struct RowTable {
    terms: usize,
    rows: usize,
    /// `[k][row]`
    values: Vec<f64>,
}

impl RowTable {
    /// The polynomial along a row at squares of p_x.
    #[inline(always)]
    fn at<S: Simd>(&self, row: usize, square: Lanes<S>) -> Lanes<S> {
        let mut sum = square.constant(0.0);
        for k in (0..self.terms).rev() {
            sum = sum.mul_add(square, square.constant(self.values[k * self.rows + row]));
        }
        sum
    }

    /// Adds `bar square^k` to coefficient k of a row.
    #[inline(always)]
    fn add_moments<S: Simd>(&mut self, row: usize, bar: Lanes<S>, square: Lanes<S>) {
        let mut term = bar;
        for k in 0..self.terms {
            self.values[k * self.rows + row] += term.sum();
            term = term * square;
        }
    }

    fn zero_like(other: &Self) -> Self {
        Self { terms: other.terms, rows: other.rows, values: vec![0.0; other.values.len()] }
    }
}

/// The even and the odd part of a polynomial along each row; `None` for a part that is zero.
struct Table {
    even: Option<RowTable>,
    odd: Option<RowTable>,
}

impl Table {
    fn new(rows: &PupilRows, basis: &PupilBasis, polynomial: &PupilPolynomial) -> Self {
        let part = |parity: &Parity, coefficients: &[f64]| {
            (!coefficients.is_empty()).then(|| rows.along_rows(coefficients, &parity.powers))
        };
        Self { even: part(&basis.even, &polynomial.even), odd: part(&basis.odd, &polynomial.odd) }
    }

    /// The polynomial along a row at p_x and its square.
    #[inline(always)]
    fn at<S: Simd>(&self, row: usize, p_x: Lanes<S>, square: Lanes<S>) -> Lanes<S> {
        match (&self.even, &self.odd) {
            (Some(even), None) => even.at(row, square),
            (None, Some(odd)) => p_x * odd.at(row, square),
            (Some(even), Some(odd)) => p_x.mul_add(odd.at(row, square), even.at(row, square)),
            (None, None) => p_x.constant(0.0),
        }
    }

    /// The transpose of [`Table::at`].
    #[inline(always)]
    fn add_moments<S: Simd>(&mut self, row: usize, bar: Lanes<S>, p_x: Lanes<S>, square: Lanes<S>) {
        if let Some(even) = &mut self.even {
            even.add_moments(row, bar, square);
        }
        if let Some(odd) = &mut self.odd {
            odd.add_moments(row, bar * p_x, square);
        }
    }

    fn zero_like(other: &Self) -> Self {
        Self {
            even: other.even.as_ref().map(RowTable::zero_like),
            odd: other.odd.as_ref().map(RowTable::zero_like),
        }
    }

    /// Adds the cotangents of the coefficients, from those of the table.
    fn pull_back(&self, rows: &PupilRows, basis: &PupilBasis, to: &mut PupilPolynomial) {
        if let Some(even) = &self.even {
            rows.pull_back(even, &basis.even.powers, &mut to.even);
        }
        if let Some(odd) = &self.odd {
            rows.pull_back(odd, &basis.odd.powers, &mut to.odd);
        }
    }
}

/// A map in the form of tables, for evaluation row by row.
pub(crate) struct DenseMap<'a> {
    map: &'a PupilMap,
    rows: &'a PupilRows,
    x: Table,
    y: Table,
    light: Table,
    heights: Vec<Table>,
}

/// Points of a row: positions on the image and light (0 beyond the last point).
#[derive(Clone, Copy)]
pub(crate) struct Points<S: Simd> {
    p_x: Lanes<S>,
    square: Lanes<S>,
    /// On the image plane, mm.
    pub x: Lanes<S>,
    /// On the image plane, mm.
    pub y: Lanes<S>,
    /// Light through the clear apertures.
    pub weight: Lanes<S>,
    /// Transmission of the apertures.
    transmission: Lanes<S>,
    /// Weight of the points themselves, without light.
    share: Lanes<S>,
}

/// Cotangents of points: by x, y (1/mm) and weight.
#[derive(Clone, Copy)]
pub(crate) struct PointsCotangent<S: Simd> {
    pub x: Lanes<S>,
    pub y: Lanes<S>,
    pub weight: Lanes<S>,
}

/// Cotangents, summed over rows.
pub(crate) struct DenseCotangent {
    x: Table,
    y: Table,
    light: Table,
    heights: Vec<Table>,
    semi_diameters: Vec<f64>,
}

/// Changes of points: of x, y (mm) and weight.
pub(crate) type PointsTangent<S> = PointsCotangent<S>;

/// Changes of the tables and of the semi-diameters (mm), laid out as their cotangents.
pub(crate) type DenseTangent = DenseCotangent;

const COUNTING: [f64; MAX_LANES] = {
    let mut all = [0.0; MAX_LANES];
    let mut i = 0;
    while i < MAX_LANES {
        all[i] = i as f64;
        i += 1;
    }
    all
};

impl<'a> DenseMap<'a> {
    pub fn new(map: &'a PupilMap, rows: &'a PupilRows) -> Self {
        let table = |polynomial| Table::new(rows, map.basis(), polynomial);
        Self {
            map,
            rows,
            x: table(&map.image[0]),
            y: table(&map.image[1]),
            light: table(&map.light),
            heights: map.heights.iter().map(|h| table(&h.polynomial)).collect(),
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows.rows.len()
    }

    /// Number of calls of [`DenseMap::points`] for all points of a row.
    #[inline(always)]
    pub fn turns<S: Simd>(&self, row: usize) -> usize {
        self.rows.rows[row].count.div_ceil(width::<S>())
    }

    /// Signs of p_x to evaluate: in a symmetric lens one half of the pupil is enough.
    pub fn sides(&self) -> &'static [f64] {
        match self.map.samples.sides {
            Sides::Mirrored => &[1.0],
            Sides::Both => &[1.0, -1.0],
        }
    }

    /// Some points of a row on the side of the pupil with that sign of p_x, far from each other, so that they do not land in
    /// the same cells.
    #[inline(always)]
    pub fn points<S: Simd>(&self, simd: S, row: usize, turn: usize, side: f64) -> Points<S> {
        // Coordinates and quadrature weights of the points.
        let r = self.rows.rows[row];
        let counting = Lanes::load(simd, &COUNTING) * self.turns::<S>(row) as f64 + (turn as f64 + 0.5);
        let p_x = counting * (r.step * side);
        let square = p_x * p_x;
        let zero = p_x.constant(0.0);
        let weight = if self.sides().len() == 1 { r.weight } else { 0.5 * r.weight };
        let share = counting.lt(zero.constant(r.count as f64)).select(zero.constant(weight), zero);
        // Multiply the transmissions of the clear apertures.
        let mut transmission = zero.constant(1.0);
        for (h, table) in self.map.heights.iter().zip(&self.heights) {
            if let Some(edge) = soft_edge(table.at(row, p_x, square), h.semi_diameter_mm) {
                transmission = transmission * edge.transmission;
            }
        }
        Points {
            p_x,
            square,
            x: self.x.at(row, p_x, square),
            y: self.y.at(row, p_x, square),
            weight: share * transmission * self.light.at(row, p_x, square),
            transmission,
            share,
        }
    }

    pub fn zero_cotangent(&self) -> DenseCotangent {
        DenseCotangent {
            x: Table::zero_like(&self.x),
            y: Table::zero_like(&self.y),
            light: Table::zero_like(&self.light),
            heights: self.heights.iter().map(Table::zero_like).collect(),
            semi_diameters: vec![0.0; self.heights.len()],
        }
    }

    /// Adds the cotangents of points of a row to the sums.
    #[inline(always)]
    pub fn pull_back_points<S: Simd>(
        &self,
        row: usize,
        points: &Points<S>,
        bar: PointsCotangent<S>,
        sums: &mut DenseCotangent,
    ) {
        let (p_x, at) = (points.p_x, points.square);
        // Positions and light.
        sums.x.add_moments(row, bar.x, p_x, at);
        sums.y.add_moments(row, bar.y, p_x, at);
        sums.light.add_moments(row, bar.weight * points.share * points.transmission, p_x, at);
        if self.heights.is_empty() {
            return;
        }
        let light = self.light.at(row, p_x, at);
        let zero = at.constant(0.0);
        for (k, (h, table)) in self.map.heights.iter().zip(&self.heights).enumerate() {
            let Some(edge) = soft_edge(table.at(row, p_x, at), h.semi_diameter_mm) else { continue };
            let (through, by_u) = (edge.transmission, edge.by_radius * 0.5 / edge.radius_mm);
            // Differentiate the product of transmissions: that of the other apertures is transmission / through, or 0
            // where this aperture is closed.
            let open = zero.lt(through);
            let others = open.select(points.transmission / open.select(through, zero.constant(1.0)), zero);
            let through_bar = bar.weight * points.share * light * others;
            sums.heights[k].add_moments(row, through_bar * by_u, p_x, at);
            sums.semi_diameters[k] += (through_bar * -edge.by_radius).sum();
        }
    }

    /// Changes of the tables, from those of the map's coefficients.
    pub fn push_forward(&self, change: &MapTangent) -> DenseTangent {
        let table = |polynomial| Table::new(self.rows, self.map.basis(), polynomial);
        DenseTangent {
            x: table(&change.image[0]),
            y: table(&change.image[1]),
            light: table(&change.light),
            heights: change.heights.iter().map(table).collect(),
            semi_diameters: change.semi_diameters.clone(),
        }
    }

    /// Changes of points of a row, from those of the tables: the transpose of [`DenseMap::pull_back_points`].
    #[inline(always)]
    pub fn push_forward_points<S: Simd>(
        &self,
        row: usize,
        points: &Points<S>,
        change: &DenseTangent,
    ) -> PointsTangent<S> {
        let (p_x, at) = (points.p_x, points.square);
        let mut weight = points.transmission * change.light.at(row, p_x, at);
        if !self.heights.is_empty() {
            let light = self.light.at(row, p_x, at);
            let zero = at.constant(0.0);
            for (k, (h, table)) in self.map.heights.iter().zip(&self.heights).enumerate() {
                let Some(edge) = soft_edge(table.at(row, p_x, at), h.semi_diameter_mm) else { continue };
                // Differentiate the product of transmissions, of which this aperture is one.
                let open = zero.lt(edge.transmission);
                let through = open.select(edge.transmission, zero.constant(1.0));
                let others = open.select(points.transmission / through, zero);
                let radius = change.heights[k].at(row, p_x, at) * 0.5 / edge.radius_mm;
                weight += light * others * edge.by_radius * (radius - change.semi_diameters[k]);
            }
        }
        let weight = weight * points.share;
        PointsTangent { x: change.x.at(row, p_x, at), y: change.y.at(row, p_x, at), weight }
    }

    /// Cotangents of the map's coefficients.
    pub fn pull_back(&self, sums: &DenseCotangent) -> MapCotangent {
        let basis = self.map.basis();
        let mut map_bar = MapCotangent::zero(self.map);
        sums.x.pull_back(self.rows, basis, &mut map_bar.image[0]);
        sums.y.pull_back(self.rows, basis, &mut map_bar.image[1]);
        sums.light.pull_back(self.rows, basis, &mut map_bar.light);
        for (table, to) in sums.heights.iter().zip(&mut map_bar.heights) {
            table.pull_back(self.rows, basis, to);
        }
        map_bar.semi_diameters.copy_from_slice(&sums.semi_diameters);
        map_bar
    }
}
