// What the camera room is set to. It stays while one is in another room.

import type { EdgeRegion } from "../lib/types";

export type Shown = "after" | "before" | "split" | "raw";

class Settings {
  photo = $state("scene:siemens-star");
  /** A picture of the reader's machine, and how the server calls it. */
  own = $state.raw<{ name: string; photo: string } | undefined>();
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
  /** Where the scene lies in place of the object distance of the lens, mm, and the history of the lens of which that was said; null is infinity. */
  object = $state.raw<{ distance_mm: number | null; history: number } | undefined>();
  shown = $state<Shown>("after");
  split = $state(50);

  /** A message of the server with the reader's name of their picture. */
  named(text: string): string {
    const key = this.own?.photo.split(":")[1];
    return this.own && key ? text.replace(new RegExp(`\\S*${key}`, "g"), this.own.name) : text;
  }
}

export const settings = new Settings();
