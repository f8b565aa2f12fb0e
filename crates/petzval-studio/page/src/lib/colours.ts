// Colours of fields and wavelengths, apart in lightness as well as in hue, in light and in dark.

import { short } from "./numbers";

const FIELDS = ["#2a6fb0", "#c2571a", "#2f8f5b", "#8c4fa3", "#a8862a", "#b5476a", "#4c8c99", "#6d6f73"];

export function fieldColour(index: number): string {
  return FIELDS[index % FIELDS.length]!;
}

/** A line of a legend. */
export interface Entry {
  text: string;
  colour: string;
}

/** The fields, for a legend. */
export function fieldEntries(fields: number[]): Entry[] {
  return fields.map((field, i) => ({ text: `${short(field, 4)}°`, colour: fieldColour(i) }));
}

/** The wavelengths, for a legend. */
export function wavelengthEntries(um: number[], dark: boolean): Entry[] {
  return um.map((one) => ({ text: `${Math.round(one * 1000)} nm`, colour: wavelengthColourAt(one, dark) }));
}

/** The colour of a wavelength, as near as a display comes to it and dark enough on white. */
export function wavelengthColour(um: number): string {
  const nm = um * 1000;
  const hue = nm < 440 ? 265 : nm < 490 ? 225 : nm < 510 ? 180 : nm < 575 ? 135 : nm < 600 ? 45 : nm < 640 ? 15 : 0;
  return `hsl(${hue} 70% var(--spot-lightness))`;
}

/** The same with a lightness, for canvases, which know no variables. */
export function wavelengthColourAt(um: number, dark: boolean): string {
  return wavelengthColour(um).replace("var(--spot-lightness)", dark ? "65%" : "42%");
}
