// Numbers as people read and write them.

/** A number with so many significant digits, without a tail of zeros. */
export function short(value: number | null | undefined, digits = 6): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e7 || size < 1e-4) return value.toExponential(Math.max(0, digits - 2)).replace(/\.?0+e/, "e");
  return String(Number(value.toPrecision(digits)));
}

/** A number with so many places after the point. */
export function fixed(value: number | null | undefined, places: number): string {
  return value === null || value === undefined || !Number.isFinite(value) ? "–" : value.toFixed(places);
}

/** The mean over the fields of the RMS radius of the spots, µm; none without spots. */
export function meanRms(spots: { rms_um: number }[]): number | undefined {
  return spots.length > 0 ? spots.reduce((sum, spot) => sum + spot.rms_um, 0) / spots.length : undefined;
}

/** A number that a person wrote; a comma may stand for the point. Undefined if it is none. */
export function parsed(text: string): number | undefined {
  const plain = text.trim().replace(",", ".").replace(/^−/, "-");
  if (plain === "") return undefined;
  const value = Number(plain);
  return Number.isFinite(value) ? value : undefined;
}

/** A list of numbers that a person wrote, with commas or spaces between them. */
export function parsedList(text: string): number[] | undefined {
  const values = text.split(/[\s,;]+/).filter((part) => part !== "").map(Number);
  return values.length > 0 && values.every(Number.isFinite) ? values : undefined;
}
