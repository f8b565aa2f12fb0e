// What the camera room is set to. It stays while one is in another room.

import type { EdgeRegion } from "../lib/types";

export type Shown = "after" | "before" | "split" | "raw";

/** A picture of the reader's machine, and how the server calls it. */
interface OwnPhoto {
  name: string;
  photo: string;
}

class Settings {
  photo = $state("scene:siemens-star");
  own = $state.raw<OwnPhoto | undefined>();
  sensor = $state("imx249-fitted");
  /** The place on the sensor, as shares of its width and height. */
  at = $state.raw<[number, number]>([0.5, 0.5]);
  /** Stops above the usual exposure. */
  exposure = $state(0);
  noise = $state(true);
  /** The ISP, empty for linear development, and what was set beside its own values. */
  isp = $state("");
  set = $state.raw<Record<string, number>>({});
  /** The region of the picture whose edge is measured. */
  edge = $state.raw<EdgeRegion | undefined>();
  /** The pixel, row and column, from which a region is being drawn. */
  drawnFrom = $state.raw<[number, number] | undefined>();
  /** Where the scene lies in place of the object distance of the lens, mm, and the history of the lens of which that was said; null is infinity. */
  object = $state.raw<{ distance_mm: number | null; history: number } | undefined>();
  shown = $state<Shown>("after");
  split = $state(50);
}

export const settings = new Settings();

/** A message of the server with the reader's name of their picture. */
export function named(text: string, own = settings.own): string {
  const key = own?.photo.split(":")[1];
  return own && key ? text.replace(new RegExp(`\\S*${key}`, "g"), own.name) : text;
}
