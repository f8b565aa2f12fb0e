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

/** The name of a number without its unit. */
export const plain = (parameter: string) => parameter.replace(/_(per_)?mm$/, "");

/** Whether the radius of a surface holds the focal length or the magnification. */
export const holdsPower = (row: Row) => ["efl", "magnification"].includes(stateOf(row, "radius_mm"));

/** The value of a number as lens files name it; none of a plane's radius. */
function valueOf(row: Row, parameter: string): number | undefined {
  const power = /^a(\d+)$/.exec(parameter)?.[1];
  if (power) return row.asphere[Number(power) / 2 - 1];
  const { radius_mm, curvature_per_mm, thickness_mm, conic } = row;
  const values: Record<string, number | null> = { radius_mm, curvature_per_mm, thickness_mm, conic };
  return values[parameter] ?? undefined;
}

/** The share of the range of a variable within which its value lies at a bound. */
const AT_BOUND = 1e-5;

/** The bound at which the value of a variable lies. */
export function boundOf(row: Row, { parameter, min, max }: Variable): number | undefined {
  const value = valueOf(row, parameter);
  return value === undefined ? undefined : [min, max].find((bound) => Math.abs(value - bound) <= AT_BOUND * (max - min));
}

/** What sets a number, in words. */
export function inWords(row: Row, parameter: string): string {
  const by = settledBy(row, parameter);
  const own = variableOf(row, parameter);
  if (own) return `varies from ${short(own.min)} to ${short(own.max)}${boundOf(row, own) === undefined ? "" : ", and is at its bound"}`;
  if (!by) return "held";
  if ("efl" in by) return `holds the focal length of ${short(by.efl.efl_mm, 7)} mm`;
  if ("magnification" in by) return `holds the magnification of ${short(by.magnification.magnification, 7)}`;
  if ("length" in by) return `holds the length of ${short(by.length.length_mm, 7)} mm`;
  const { of, scale, offset } = by.pickup;
  const acts = parameter === "radius_mm" ? ", as curvatures" : "";
  return `follows surface ${of}, times ${short(scale)}${offset === 0 ? "" : `, plus ${short(offset)}`}${acts}`;
}
