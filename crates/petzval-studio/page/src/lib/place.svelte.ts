// Where one is on the page: the room, and what is shown in it. It stands in the address behind #, so that a tab that is loaded again, also after a
// restart of the studio, is where it was. Each place is an entry in the history of the browser.

import type { First, Room } from "./types";

const ROOMS: Room[] = ["lens", "camera", "task", "design", "runs"];

/** The folder whose runs are listed if none is named. */
const RUNS = "runs";

class Place {
  room = $state<Room>("lens");
  /** The run that is shown. */
  run = $state<string | undefined>();
  /** The camera of that run, whose task is shown; none for the last one whose lens moves. */
  camera = $state<string | undefined>();
  experiment = $state<string | undefined>();
  sweep = $state<string | undefined>();
  /** The folder whose runs are listed. */
  runs = $state(RUNS);

  /** Takes the place from the address; false if it holds none. */
  read(): boolean {
    const [room, query] = location.hash.slice(1).split("?");
    if (!ROOMS.includes(room as Room)) return false;
    const keys = new URLSearchParams(query);
    this.room = room as Room;
    this.run = keys.get("run") ?? undefined;
    this.camera = keys.get("camera") ?? undefined;
    this.experiment = keys.get("experiment") ?? undefined;
    this.sweep = keys.get("sweep") ?? undefined;
    this.runs = keys.get("runs") ?? RUNS;
    return true;
  }

  /** Takes what the studio was started with. */
  take(first: First): void {
    this.room = first.room;
    this.run = first.run ?? undefined;
    this.camera = undefined;
    this.experiment = first.experiment ?? undefined;
    this.sweep = first.sweep ?? undefined;
    if (first.runs) this.runs = first.runs;
    else if (first.run) this.runs = first.run.includes("/") ? first.run.slice(0, first.run.lastIndexOf("/")) : ".";
    history.replaceState(null, "", this.#address());
  }

  #address(): string {
    const keys = new URLSearchParams();
    if (this.run) keys.set("run", this.run);
    if (this.run && this.camera) keys.set("camera", this.camera);
    if (this.experiment) keys.set("experiment", this.experiment);
    if (this.sweep) keys.set("sweep", this.sweep);
    if (this.runs !== RUNS) keys.set("runs", this.runs);
    const query = keys.toString();
    return `#${this.room}${query ? `?${query}` : ""}`;
  }

  go(room: Room, what: Partial<Pick<Place, "run" | "camera" | "experiment" | "sweep" | "runs">> = {}): void {
    this.room = room;
    // A camera belongs to its run.
    if ("run" in what) this.camera = undefined;
    Object.assign(this, what);
    const address = this.#address();
    if (address !== location.hash) history.pushState(null, "", address);
  }
}

export const place = new Place();
