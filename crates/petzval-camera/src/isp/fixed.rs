//! Whole-number arithmetic as a chip does it: number formats, grids of pixels, tables.
//!
//! Between stages a value is a whole number of a declared width; what does not fit is cut off at the end of the range. What a chip's
//! driver would compute once per frame (weights, tables, limits) is computed in floating point and rounded to a format; pixels never are.

use std::cell::RefCell;
use std::ops::Range;
use std::thread::LocalKey;

use petzval_base::simd::dispatch;
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// A fixed-point number: `value = whole / 2^fraction`, between `min` and `max`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format {
    /// Bits behind the point.
    pub fraction: u32,
    /// Least whole number.
    pub min: i32,
    /// Greatest whole number.
    pub max: i32,
}

/// Light, 1 = white: 25 bits with sign, up to 16 times white, to -1.
pub const LINEAR: Format = Format { fraction: 20, min: -(1 << 20), max: (1 << 24) - 1 };
/// The square root of light: 16 bits with sign, up to 4, to -1.
pub const ROOT: Format = Format { fraction: 13, min: -(1 << 13), max: (1 << 15) - 1 };
/// The difference of two roots of light: 16 bits with sign, from -4 to 4.
pub const COLOUR: Format = Format { fraction: 13, min: -(1 << 15), max: (1 << 15) - 1 };
/// Encoded for a display, 1 = white: 16 bits with sign, up to 2, to -1/2.
pub const ENCODED: Format = Format { fraction: 14, min: -(1 << 13), max: (1 << 15) - 1 };
/// A factor below 16: 16 bits.
pub const GAIN: Format = Format { fraction: 12, min: 0, max: (1 << 16) - 1 };
/// A weight between -8 and 8: 16 bits with sign.
pub const WEIGHT: Format = Format { fraction: 12, min: -(1 << 15), max: (1 << 15) - 1 };
/// A binary logarithm between -16 and 16: 16 bits with sign.
pub const LOG2: Format = Format { fraction: 11, min: -(1 << 15), max: (1 << 15) - 1 };

impl Format {
    /// The whole number of 1.
    pub const fn one(self) -> i32 {
        1 << self.fraction
    }

    /// Bits of the format, its sign included.
    pub const fn bits(self) -> u32 {
        let magnitude = if -(self.min as i64) - 1 > self.max as i64 { -(self.min + 1) } else { self.max };
        32 - magnitude.leading_zeros() + (self.min < 0) as u32
    }

    /// The nearest whole number of a value; what is no number is 0.
    pub fn of(self, value: f64) -> i32 {
        (value * f64::from(self.one())).round().clamp(self.min.into(), self.max.into()) as i32
    }

    /// The nearest value that fits.
    pub fn nearest(self, value: f64) -> f64 {
        self.value(self.of(value))
    }

    /// Whether a value lies so far beyond the range that more than a step of it is cut off.
    pub fn cuts(self, value: f64) -> bool {
        let whole = value * f64::from(self.one());
        whole < f64::from(self.min) - 1.0 || whole > f64::from(self.max) + 1.0
    }

    /// Cuts off what does not fit.
    #[inline(always)]
    pub fn clamp(self, value: i32) -> i32 {
        value.clamp(self.min, self.max)
    }

    /// Cuts off what does not fit of a wide intermediate.
    #[inline(always)]
    pub fn narrow(self, value: i64) -> i32 {
        value.clamp(self.min.into(), self.max.into()) as i32
    }

    /// Cuts off what does not fit, for a grid of 16-bit numbers; the format has at most 16 bits with its sign.
    #[inline(always)]
    pub fn short(self, value: i32) -> i16 {
        self.clamp(value) as i16
    }

    /// The value of a whole number.
    pub fn value(self, whole: i32) -> f64 {
        f64::from(whole) / f64::from(self.one())
    }
}

/// `value / 2^bits`, rounded half up. `bits` is at least 1.
#[inline(always)]
pub fn shift_round(value: i32, bits: u32) -> i32 {
    (value + (1 << (bits - 1))) >> bits
}

/// `value * factor / 2^12`, rounded half up, in 32 bits: of a value of 25 bits with sign and a factor of 16 bits without, or with, sign.
///
/// The upper and the lower 12 bits of the value are multiplied apart; only the lower product has digits to round.
#[inline(always)]
pub fn scaled(value: i32, factor: i32) -> i32 {
    (value >> 12) * factor + shift_round((value & 0xfff) * factor, 12)
}

/// [`shift_round`] of a wide intermediate.
#[inline(always)]
pub fn shift_round_wide(value: i64, bits: u32) -> i64 {
    (value + (1 << (bits - 1))) >> bits
}

/// Pixels around a grid that mirror its outermost ones; even, so that they keep the phase of a Bayer array.
pub const BORDER: usize = 8;

/// Rows that a thread takes at a time.
const ROWS: usize = 16;

/// What a pixel of a grid holds: a number of 16 bits where the format allows it, since memory is what most stages wait for.
pub trait Pixel: Copy + Default + Send + Sync + 'static {
    /// Buffers of this thread's grids that are no longer used.
    fn spare() -> &'static Spare<Self>;
}

/// Buffers of a thread.
type Spare<T> = LocalKey<RefCell<Vec<Vec<T>>>>;

/// Three colours side by side; the fourth number fills up.
pub type ColourPixel = [i16; 4];

macro_rules! pixels {
    ($($pixel:ty: $spare:ident),*) => {$(
        thread_local! {
            static $spare: RefCell<Vec<Vec<$pixel>>> = const { RefCell::new(Vec::new()) };
        }
        impl Pixel for $pixel {
            fn spare() -> &'static Spare<Self> {
                &$spare
            }
        }
    )*};
}

pixels!(i16: SPARE_16, i32: SPARE_32, ColourPixel: SPARE_COLOUR_PIXELS);

/// Gives the memory of this thread's unused grids back.
pub fn release_spare_memory() {
    i16::spare().take();
    i32::spare().take();
    ColourPixel::spare().take();
}

/// Runs a loop over pixels that fills no grid, compiled for the widest vectors of the machine. It and all that it calls have to be inlined.
#[inline(always)]
pub fn in_vectors<R>(of: impl FnOnce() -> R) -> R {
    struct Loop<F>(F);
    impl<R, F: FnOnce() -> R> WithSimd for Loop<F> {
        type Output = R;

        #[inline(always)]
        fn with_simd<S: Simd>(self, _: S) -> R {
            (self.0)()
        }
    }
    dispatch(Loop(of))
}

/// Pixels that are computed on the stack before they are written; see [`by_blocks`].
pub const BLOCK: usize = 128;

/// Writes rows block by block: `of` computes some pixels of each.
///
/// The compiler must assume that a table lies in the row that is written, and then does not vectorise the loop. It does vectorise a loop
/// that writes to the stack.
#[inline(always)]
pub fn by_blocks<T: Stored, const N: usize>(
    mut rows: [&mut [T]; N],
    of: impl Fn(Range<usize>, &mut [[i32; BLOCK]; N]),
) {
    let width = rows.first().map_or(0, |row| row.len());
    for start in (0..width).step_by(BLOCK) {
        let pixels = start..(start + BLOCK).min(width);
        let mut block = [[0; BLOCK]; N];
        of(pixels.clone(), &mut block);
        for (row, block) in rows.iter_mut().zip(&block) {
            for (out, v) in row[pixels.clone()].iter_mut().zip(block) {
                *out = T::stored(*v);
            }
        }
    }
}

/// A number of a grid.
pub trait Stored {
    /// A whole number, which fits.
    fn stored(whole: i32) -> Self;
}

impl Stored for i16 {
    #[inline(always)]
    fn stored(whole: i32) -> Self {
        debug_assert!(i16::try_from(whole).is_ok(), "{whole} was not cut off at the end of its format");
        whole as i16
    }
}

impl Stored for i32 {
    #[inline(always)]
    fn stored(whole: i32) -> Self {
        whole
    }
}

/// A plane of whole numbers with a mirrored border, and room for a block behind it.
///
/// The memory of a grid that is dropped serves the next one of its size on the same thread: pages that the system must clear first cost
/// more time than most stages do. [`release_spare_memory`] ends this.
pub struct Grid<T: Pixel> {
    pub height: usize,
    pub width: usize,
    data: Vec<T>,
}

impl<T: Pixel> Drop for Grid<T> {
    fn drop(&mut self) {
        T::spare().with_borrow_mut(|spare| spare.push(std::mem::take(&mut self.data)));
    }
}

impl<T: Pixel> Grid<T> {
    /// A copy.
    pub fn copied(&self) -> Self {
        Self::from_rows(
            self.size(),
            #[inline(always)]
            |row, out| out.copy_from_slice(self.row(row)),
        )
    }

    /// Height and width.
    pub fn size(&self) -> [usize; 2] {
        [self.height, self.width]
    }

    fn stride(&self) -> usize {
        self.width + 2 * BORDER
    }

    /// The grid whose rows `fill` writes, with the border of the outermost pixels. `fill` depends on the row alone and writes every pixel.
    pub fn from_rows(size: [usize; 2], fill: impl Fn(usize, &mut [T]) + Sync) -> Self {
        let [grid] = Self::several_from_rows(
            size,
            #[inline(always)]
            |row, [out]| fill(row, out),
        );
        grid
    }

    /// Several grids at once, whose rows `fill` writes together.
    pub fn several_from_rows<const N: usize>(
        [height, width]: [usize; 2],
        fill: impl Fn(usize, [&mut [T]; N]) + Sync,
    ) -> [Self; N] {
        let stride = width + 2 * BORDER;
        let mut grids = [(); N].map(|()| Self::buffer((height + 2 * BORDER) * stride + BLOCK));
        let mut chunks = grids
            .each_mut()
            .map(|data| data[BORDER * stride..(BORDER + height) * stride].chunks_mut(ROWS * stride));
        let work: Vec<[&mut [T]; N]> = (0..height.div_ceil(ROWS))
            .map(|_| chunks.each_mut().map(|rows| rows.next().unwrap_or_default()))
            .collect();
        work.into_par_iter().enumerate().for_each(|(chunk, lines)| {
            // Compiled for the widest vectors of the machine.
            dispatch(Fill { fill: &fill, first: chunk * ROWS, lines, stride });
        });
        grids.map(|data| Self::mirrored(height, width, data))
    }

    /// Memory of `len` numbers, of a former grid if one is left.
    fn buffer(len: usize) -> Vec<T> {
        let spare = T::spare().with_borrow_mut(|spare| {
            let found = spare.iter().position(|buffer| buffer.len() == len);
            found.map(|i| spare.swap_remove(i))
        });
        // By all threads: to clear its pages takes longer than many a stage.
        spare.unwrap_or_else(|| rayon::iter::repeat_n(T::default(), len).collect())
    }

    /// A grid whose rows above and below it are not filled yet.
    fn mirrored(height: usize, width: usize, mut data: Vec<T>) -> Self {
        let (stride, last) = (width + 2 * BORDER, BORDER + height - 1);
        for k in 1..=BORDER {
            data.copy_within((BORDER + k) * stride..(BORDER + k + 1) * stride, (BORDER - k) * stride);
            data.copy_within((last - k) * stride..(last - k + 1) * stride, (last + k) * stride);
        }
        Self { height, width, data }
    }

    /// The row `down` rows below `row`, moved by `right` columns: as many values as the grid is wide.
    ///
    /// `down` and `right` reach at most [`BORDER`] beyond the grid.
    #[inline(always)]
    pub fn near(&self, row: usize, down: isize, right: isize) -> &[T] {
        let start =
            (row + BORDER).wrapping_add_signed(down) * self.stride() + BORDER.wrapping_add_signed(right);
        &self.data[start..start + self.width]
    }

    /// The neighbourhood of a row of `width` pixels, all of the grid's: that the length is given makes the compiler see that it is one.
    #[inline(always)]
    pub fn around(&self, row: usize, width: usize) -> Around<'_, T> {
        Around { grid: self, row, width }
    }

    /// Four pixels of a row; `(row, col)` is the second of them, and may lie in the border.
    #[inline(always)]
    pub fn four(&self, row: i32, col: i32) -> &[T] {
        let start = (row + BORDER as i32) as usize * self.stride() + col as usize + BORDER - 1;
        &self.data[start..start + 4]
    }

    /// A row of the grid.
    #[inline(always)]
    pub fn row(&self, row: usize) -> &[T] {
        self.near(row, 0, 0)
    }
}

/// The filling of some rows of grids, as an operation that is compiled for every instruction set.
struct Fill<'a, T, F, const N: usize> {
    fill: &'a F,
    first: usize,
    lines: [&'a mut [T]; N],
    stride: usize,
}

impl<T: Pixel, F: Fn(usize, [&mut [T]; N]), const N: usize> WithSimd for Fill<'_, T, F, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let rows = self.lines.first().map_or(0, |lines| lines.len() / self.stride);
        for i in 0..rows {
            let line = i * self.stride;
            let inside = self.lines.each_mut().map(
                #[inline(always)]
                |lines| &mut lines[line + BORDER..line + self.stride - BORDER],
            );
            (self.fill)(self.first + i, inside);
            self.lines.iter_mut().for_each(|lines| mirror_ends(&mut lines[line..line + self.stride]));
        }
    }
}

/// The neighbourhood of a row; see [`Grid::around`].
#[derive(Clone, Copy)]
pub struct Around<'g, T: Pixel> {
    grid: &'g Grid<T>,
    row: usize,
    width: usize,
}

impl<'g, T: Pixel> Around<'g, T> {
    /// [`BLOCK`] pixels from column `start` of the row `down` rows below, moved by `right` columns. Beyond the end of the row they have no
    /// meaning: there every block is whole, so that loops over it are of a known length.
    #[inline(always)]
    pub fn block(self, down: isize, right: isize, start: usize) -> &'g [T; BLOCK] {
        let line = (self.row + BORDER).wrapping_add_signed(down) * self.grid.stride();
        let at = line + (start + BORDER).wrapping_add_signed(right);
        self.grid.data[at..].first_chunk().unwrap_or_else(|| unreachable!("a block behind the last row"))
    }

    /// The row `down` rows below, moved by `right` columns.
    #[inline(always)]
    pub fn at(self, down: isize, right: isize) -> &'g [T] {
        &self.grid.near(self.row, down, right)[..self.width]
    }
}

/// Blocks of the eight neighbours at a distance: above, left, right, below, then the corners in the same order of rows.
#[inline(always)]
pub fn eight(near: Around<'_, i16>, step: isize, start: usize) -> [&[i16; BLOCK]; 8] {
    [
        near.block(-step, 0, start),
        near.block(0, -step, start),
        near.block(0, step, start),
        near.block(step, 0, start),
        near.block(-step, -step, start),
        near.block(-step, step, start),
        near.block(step, -step, start),
        near.block(step, step, start),
    ]
}

/// Fills the borders of a row left and right of its pixels.
#[inline(always)]
fn mirror_ends<T: Pixel>(line: &mut [T]) {
    let end = line.len() - BORDER;
    for k in 0..BORDER {
        line[k] = line[2 * BORDER - k];
        line[end + k] = line[end - 2 - k];
    }
}

/// A knot of a table: its value in the lower 16 bits, the step to the next knot in the upper. One access fetches both.
pub fn packed(value: i32, step: i32) -> i32 {
    (step << 16) | (value & 0xffff)
}

/// The value at `rest / 2^bits` of the way from a [`packed`] knot to the next one.
#[inline(always)]
pub fn between(knot: i32, rest: i32, bits: u32) -> i32 {
    i32::from(knot as i16) + (((knot >> 16) * rest) >> bits)
}

/// Bits of the knots of each octave of an [`OctaveTable`].
const KNOT_BITS: u32 = 5;

/// Room for the knots of 31 octaves, a power of two: an index of fewer bits needs no check, so that loops over pixels become vectors.
const KNOTS: usize = 1024;

/// A function of a whole number from 0, by 32 knots in every octave and straight lines between them.
#[derive(Clone, Debug)]
pub struct OctaveTable {
    knots: Box<[i32; KNOTS]>,
}

impl OctaveTable {
    /// The table of `function` for whole numbers up to `max`, its values rounded by `to`, a format of 16 bits.
    pub fn new(max: i32, to: Format, function: impl Fn(f64) -> f64) -> Self {
        let octaves = 31 - max.leading_zeros().min(30);
        let count = (octaves.saturating_sub(KNOT_BITS) + 2) << KNOT_BITS;
        // Knots 0 to 63 are whole numbers themselves; then every 32 the step doubles.
        let shift = |i: u32| (i >> KNOT_BITS).saturating_sub(1);
        let value = |i: u32| {
            let at = u64::from(i - (shift(i) << KNOT_BITS)) << shift(i);
            to.of(function(at as f64))
        };
        let mut knots = Box::new([0; KNOTS]);
        let mut next = value(0);
        for i in 0..=count {
            let low = next;
            next = value(i + 1);
            let step = next - low;
            let fits = i16::try_from(low).is_ok() && i16::try_from(step).is_ok();
            assert!(
                fits && i64::from(step.abs()) << shift(i) <= i64::from(i32::MAX),
                "the function is too steep"
            );
            knots[i as usize] = packed(low, step);
        }
        Self { knots }
    }

    /// The value at a whole number, which is not negative and at most the greatest of the table.
    #[inline(always)]
    pub fn at(&self, whole: i32) -> i32 {
        let whole = whole.max(0) as u32;
        let shift = (31 - (whole | 1).leading_zeros()).saturating_sub(KNOT_BITS);
        let index = ((shift << KNOT_BITS) + (whole >> shift)) as usize;
        between(self.knots[index % KNOTS], (whole & ((1 << shift) - 1)) as i32, shift)
    }
}

/// The upper half of the product of two numbers, cut off: what a multiplier of 16 bits gives.
#[inline(always)]
fn high(a: i16, b: i16) -> i16 {
    ((i32::from(a) * i32::from(b)) >> 16) as i16
}

/// Twice a number, cut off at the end of its range. A compiler would merge a shift with the product in front of it, and compute both in
/// 32 bits.
#[inline(always)]
pub fn doubled(a: i16) -> i16 {
    a.saturating_add(a)
}

/// Tukey's biweight, `(1 - (d / limit)^2)^2` within the limit and 0 beyond, in numbers of 16 bits throughout: twice as many fit into a
/// vector as of 32.
///
/// A mean of differences that is weighted by it follows the neighbours where they differ as noise does, and ignores them across an edge
/// (Black, Sapiro, Marimont, Heeger, "Robust anisotropic diffusion", IEEE TIP 1998).
#[derive(Clone, Copy, Debug)]
pub struct Biweight {
    limit: i16,
    /// The power of two that brings the limit between `2^14` and `2^15`.
    scale: i16,
    /// Just below `2^29 / (scale limit)`.
    inverse: i16,
}

impl Biweight {
    /// The weight within a limit in [`ROOT`], from one step of it to [`MOST_LIMIT`](Self::MOST_LIMIT).
    pub fn new(limit: f64) -> Self {
        let limit = ROOT.of(limit).clamp(1, ROOT.one() - 1);
        let scale = 1 << (limit.leading_zeros() - 17);
        // So much below that the share of the limit stays below 1.
        let inverse = ((1 << 29) - (1 << 15)) / (limit * scale);
        Self { limit: limit as i16, scale: scale as i16, inverse: inverse as i16 }
    }

    /// Largest limit, in units of white. Up to it, the sum of the influences of twelve neighbours fits into 16 bits.
    pub const MOST_LIMIT: f64 = 1.0;

    #[inline(always)]
    fn held(self, difference: i16) -> i16 {
        difference.max(-self.limit).min(self.limit)
    }

    /// The weight of a difference, 15 bits behind the point, below 1.
    #[inline(always)]
    pub fn weight(self, difference: i16) -> i16 {
        -self.minus_weight(difference)
    }

    /// The weight, negative: of a number that is never negative a compiler forgets the sign, and computes the product with one that has
    /// a sign in 32 bits.
    #[inline(always)]
    fn minus_weight(self, difference: i16) -> i16 {
        // Bits behind the point: 13 of the share, then 15; 14 of its square; 15 of what is left of 1.
        let share = doubled(doubled(high(self.held(difference).wrapping_mul(self.scale), self.inverse)));
        let rest = doubled(high(share, share).saturating_sub((1 << 14) - 1));
        doubled(-high(rest, rest))
    }

    /// A difference times its weight, rounded up: on average half a step too high.
    #[inline(always)]
    pub fn influence(self, difference: i16) -> i16 {
        -high(doubled(self.held(difference)), self.minus_weight(difference))
    }

    /// [`influence`](Self::influence) times another weight, rounded up once.
    #[inline(always)]
    pub fn influence_by(self, difference: i16, other: i16) -> i16 {
        let minus_weight = doubled(high(self.minus_weight(difference), other));
        -high(doubled(self.held(difference)), minus_weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_have_the_declared_widths_and_cut_off_what_does_not_fit() {
        let widths = [LINEAR, ROOT, COLOUR, ENCODED, GAIN, WEIGHT, LOG2].map(Format::bits);
        assert_eq!(widths, [25, 16, 16, 16, 16, 16, 16]);
        for format in [LINEAR, ROOT, COLOUR, ENCODED, GAIN, WEIGHT, LOG2] {
            assert_eq!((format.of(1e9), format.of(-1e9), format.of(f64::NAN)), (format.max, format.min, 0));
            assert_eq!((format.narrow(i64::MAX), format.clamp(i32::MIN)), (format.max, format.min));
            assert_eq!(format.value(format.one()), 1.0);
        }
        assert_eq!((shift_round(3, 1), shift_round(-3, 1), shift_round_wide(5, 2)), (2, -1, 1));
    }

    #[test]
    fn a_product_in_two_halves_is_the_wide_one() {
        for value in (LINEAR.min..=LINEAR.max).step_by(7919).chain([LINEAR.min, -1, 0, 1, LINEAR.max]) {
            for factor in [GAIN.min, 1, 4095, 4096, 30_001, GAIN.max, WEIGHT.min, -1, WEIGHT.max] {
                let wide = shift_round_wide(i64::from(value) * i64::from(factor), 12);
                assert_eq!(i64::from(scaled(value, factor)), wide, "{value} {factor}");
            }
        }
    }

    #[test]
    fn a_table_follows_its_function_over_the_whole_range() {
        let one = f64::from(LINEAR.one());
        let table = OctaveTable::new(LINEAR.max, ROOT, |v| (v / one).sqrt());
        for whole in (0..1000).chain((0..=LINEAR.max).step_by(4999)).chain([LINEAR.max]) {
            let wanted = ROOT.of((f64::from(whole) / one).sqrt());
            assert!((table.at(whole) - wanted).abs() <= 2, "{whole}: {} {wanted}", table.at(whole));
        }
    }

    #[test]
    fn the_border_mirrors_the_grid() {
        let grid = Grid::from_rows([20, 24], |r, line: &mut [i32]| {
            (0..24).for_each(|c| line[c] = (100 * r + c) as i32)
        });
        assert_eq!(grid.near(0, -2, 0)[..2], [200, 201]);
        assert_eq!(grid.near(19, 3, 0)[0], 1600);
        assert_eq!(grid.near(5, 0, -3)[..4], [503, 502, 501, 500]);
        assert_eq!(grid.near(5, 1, 4)[19..], [623, 622, 621, 620, 619]);
    }

    #[test]
    fn the_biweight_is_that_of_the_formula() {
        for limit in [1e-4, 0.0005, 0.01, 0.7, 1.0, 3.0] {
            let biweight = Biweight::new(limit);
            let whole = f64::from(ROOT.of(limit).clamp(1, ROOT.one() - 1));
            for d in (-32768..=32767).step_by(37) {
                let share = (f64::from(d) / whole).clamp(-1.0, 1.0);
                let weight = (1.0 - share * share).powi(2);
                let got = f64::from(biweight.weight(d as i16)) / 32768.0;
                assert!((got - weight).abs() < 1e-3, "{limit} {d}: {got} {weight}");
                let wanted = f64::from(d).clamp(-whole, whole) * weight;
                for (got, wanted) in [
                    (biweight.influence(d as i16), wanted),
                    (biweight.influence_by(d as i16, 1 << 14), 0.5 * wanted),
                ] {
                    // Rounded up, and of weights of 15 bits.
                    let apart = f64::from(got) - wanted;
                    assert!((-1e-3 * whole..=1.0 + 1e-3 * whole).contains(&apart), "{limit} {d}: {apart}");
                }
            }
        }
    }

    #[test]
    fn sums_over_twelve_neighbours_keep_to_16_bits() {
        let biweight = Biweight::new(Biweight::MOST_LIMIT);
        let most = (0..=i16::MAX).map(|d| biweight.influence(d)).max().unwrap();
        assert!((2300..2400).contains(&most) && 12 * i32::from(most) < 1 << 15, "{most}");
    }
}
