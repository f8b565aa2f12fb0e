// What sets a number of a surface: nothing, an optimisation, a pickup or a solve.

import { short } from "../lib/numbers";
import type { Row, SettledBy, Variable } from "../lib/types";

export type Choice = "held" | "varies" | "pickup" | "efl" | "magnification" | "length";

/** The letter beside a number. */
export const MARKS: Record<Choice, string> = { held: "·", varies: "V", pickup: "P", efl: "S", magnification: "S", length: "S" };

/** The variable of a number. A radius that passes through the plane varies by its curvature. */
export function variableOf(row: Row, parameter: string): Variable | undefined {
  return row.varies.find((v) => v.parameter === parameter || (parameter === "radius_mm" && v.parameter === "curvature_per_mm"));
}

/** The pickup or solve that settles a number. */
export function settledBy(row: Row, parameter: string): SettledBy | undefined {
  return row.settled.find((one) => one.parameter === parameter)?.by;
}

export function stateOf(row: Row, parameter: string): Choice {
  const by = settledBy(row, parameter);
  if (by) return Object.keys(by)[0] as Choice;
  return variableOf(row, parameter) ? "varies" : "held";
}

/** The same in words. */
export function inWords(row: Row, parameter: string): string {
  const by = settledBy(row, parameter);
  const own = variableOf(row, parameter);
  if (own) return `varies from ${short(own.min)} to ${short(own.max)}`;
  if (!by) return "held";
  if ("efl" in by) return `holds the focal length of ${short(by.efl.efl_mm, 7)} mm`;
  if ("magnification" in by) return `holds the magnification of ${short(by.magnification.magnification, 7)}`;
  if ("length" in by) return `holds the length of ${short(by.length.length_mm, 7)} mm`;
  const { of, scale, offset } = by.pickup;
  const acts = parameter === "radius_mm" ? ", as curvatures" : "";
  return `follows surface ${of}, times ${short(scale)}${offset === 0 ? "" : `, plus ${short(offset)}`}${acts}`;
}
