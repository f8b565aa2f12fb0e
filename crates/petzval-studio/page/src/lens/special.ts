// What is special about a surface, for a reader: lines of a lens file with sensible digits.

import { short } from "../lib/numbers";

const DIGITS = 4;

/** Places of millimetres and degrees: finer ones are below what is made. */
const PLACES = 4;

/** Degrees of a radian. */
const DEGREES = 180 / Math.PI;

const numbersOf = (text: string) => text.split(",").map(Number);

/** A line of a lens file about a surface. A placement is given by its decentre in mm and its tilt in degrees. */
export function specialInWords(line: string): string {
  const placed = /^placement = \{ decenter_mm = \[(.+?)\], tilt_(deg|rad) = \[(.+?)\], axis = "(\w+)" \}$/.exec(line);
  if (!placed) return line.replace(/-?\d+\.\d{5,}(e[+-]?\d+)?/g, (text) => short(Number(text), DIGITS));
  const [, decentre, unit, tilt, axis] = placed as unknown as string[];
  const along = (values: number[]) => values.map((value, i) => `${"xyz"[i]} ${short(Number(value.toFixed(PLACES)), DIGITS)}`).join(", ");
  const degrees = numbersOf(tilt!).map((value) => (unit === "rad" ? value * DEGREES : value));
  return `decentre, mm: ${along(numbersOf(decentre!))}; tilt, °: ${along(degrees)}${axis === "returns" ? "" : `; the axis ${axis}`}`;
}
