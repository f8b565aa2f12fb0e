// Plots of sweeps: axes, and the points that no other beats.

/** Which way is better: upward, downward, or neither. */
export type Direction = -1 | 0 | 1;

interface Point {
  x: number;
  y: number;
}

/** The points that no other beats in both, along the horizontal axis. Of equal points the first stands for all. */
export function front<P extends Point>(points: P[], x: Direction, y: Direction): P[] {
  const sorted = [...points].sort((a, b) => x * (b.x - a.x) || y * (b.y - a.y));
  const found: P[] = [];
  for (const point of sorted) {
    const last = found.at(-1);
    if (!last || y * (point.y - last.y) > 0) found.push(point);
  }
  return found;
}

/** The range of values with a margin; never empty. */
export function spread(values: number[]): [number, number] {
  const low = Math.min(...values);
  const high = Math.max(...values);
  if (!Number.isFinite(low) || !Number.isFinite(high)) return [0, 1];
  const margin = high > low ? 0.05 * (high - low) : 0.05 * Math.max(Math.abs(low), 1);
  return [low - margin, high + margin];
}

/** Round numbers in a range. */
export function ticks([low, high]: [number, number]): number[] {
  const rough = (high - low) / 5;
  const decade = 10 ** Math.floor(Math.log10(rough));
  const step = decade * ([1, 2, 5, 10].find((digit) => digit * decade >= rough) ?? 10);
  const found: number[] = [];
  for (let tick = Math.ceil(low / step) * step; tick <= high; tick += step) found.push(Number(tick.toPrecision(12)));
  return found;
}
