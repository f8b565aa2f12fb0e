// The lens that is worked on: its states as texts, what is seen of it, and how it changes.
//
// A state is the text of a lens file, which holds the lens to the last bit: undo puts back the very text.

import { alike } from "./alike";
import { below } from "./paths";
import { CallError, Live, server } from "./server.svelte";
import type { Defocus, Edit, First, Loss, Opened, State, View } from "./types";

/** A state of the lens, and what led to it. */
interface Step {
  toml: string;
  what: string;
}

/** Limits of the lens, by the keys of an optimisation's goal. */
export interface Limits {
  edge?: number;
  centre?: number;
  air?: number;
  track?: number;
  clear_diameter?: number;
  distortion?: number;
}

export interface Notice {
  kind: "error" | "warning" | "info";
  text: string;
  details?: string[];
  /** What one may do about it. */
  action?: { name: string; run: () => void };
}

/** What a tab holds of a lens, also when it is loaded again. */
interface Kept {
  steps: Step[];
  at: number;
  before: string;
  saved: string;
  savedAs: string;
  /** The name by which the lens was opened. */
  opened?: string;
  /** The first lens that the studio was started with, as text; another one after a start with another lens. */
  named?: string;
}

/** The lens of the experiment that is designed where none is named. */
const USUAL_LENS = "cooke-triplet-nominal";

/** Most states that are kept. */
const MOST_STEPS = 500;

/** Where the states are kept when the page is loaded again. */
const STORE = "petzval-studio";

/** Milliseconds of rest after which the exact view follows the quick one. */
const REST_MS = 120;

/** Parts of a view that are looked at apart, and where they stand in it. */
export type Part = keyof typeof PARTS;
const PARTS = { layout: "layout", spots: "spots", fans: "fans", mtf: "mtf", "field-curves": "field_curves" } as const;

/** What an edit leaves as it is for the most part. The rest changes with every ray. */
const STAYS = ["surfaces", "wavelengths_um", "stated_wavelengths_um", "fields_deg", "stated_fields_deg", "violations", "problems", "layout"] as const;

/** A view with these parts of another one, and with all else of it if the layout is among them. */
function joined(before: View, view: View, parts: Part[]): View {
  const isWhole = parts.includes("layout");
  const [base, over] = isWhole ? [before, view] : [view, before];
  const found: View = { ...over };
  const keys = (Object.keys(PARTS) as Part[]).filter((part) => parts.includes(part) !== isWhole).map((part) => PARTS[part]);
  for (const key of keys) Object.assign(found, { [key]: base[key] });
  for (const key of STAYS) Object.assign(found, { [key]: alike(before[key], found[key]) });
  return found;
}

class Session {
  /** What the server says of itself. */
  about = $state.raw<State | undefined>();
  steps = $state.raw<Step[]>([]);
  at = $state(0);
  view = $state.raw<View | undefined>();
  /** The parts that the view was computed with; everything if empty. */
  #computed = $state.raw<string[]>([]);
  /** By how much the quick view of the same lens differed from the exact one: of the largest RMS spot. */
  difference = $state<number | undefined>();
  /** Edits that are being dragged, on top of the present state. */
  dragged = $state.raw<Edit[]>([]);
  notice = $state.raw<Notice | undefined>();
  /** What was said of the lens when it was last looked at. */
  warnings = $state.raw<string[]>([]);
  /** How far the lens of the last exact view is out of focus. */
  outOfFocus = $state.raw<Defocus | undefined>();
  limits = $state<Limits>({ edge: 0.1, air: 0.05 });
  /** The state that pictures and figures are compared with. */
  before = $state.raw("");
  /** The file of the last saving, and its text. */
  savedAs = $state("");
  saved = $state.raw("");
  /** The name by which the lens was opened. */
  opened = $state("");
  selected = $state(0);
  /** Highest frequency of the MTF, cycles/mm; held while a lens is worked on. */
  maxFrequency = $state<number | undefined>();
  /** What the room shows of the lens; everything if empty. */
  parts = $state.raw<string[]>([]);

  /** Parts of the view that lie outside of the window. */
  readonly #unseen = new Set<Part>();

  readonly live = new Live(server, "lens");
  /** Modulation and field curves of a drag take several times as long as rays: they follow on a channel of their own. */
  readonly #slow = new Live(server, "lens-slow");
  /** Exact views take longer: a drag does not wait for them. */
  readonly #exact = new Live(server);
  /** Calls for rays that come for one of those of modulation. */
  static readonly #RAYS_FIRST = 2;
  #rest: ReturnType<typeof setTimeout> | undefined;
  #commits: Promise<boolean> = Promise.resolve(true);
  /** Number of the history: each lens that is opened begins one. */
  #history = $state(0);
  /** The lens that the studio was started with. */
  #named: string | undefined;

  constructor() {
    this.live.lead(this.#slow, Session.#RAYS_FIRST);
  }

  /** Grows with each lens that is opened. */
  get history(): number {
    return this.#history;
  }

  get toml(): string {
    return this.steps[this.at]?.toml ?? "";
  }

  /** Whether the lens began as that of the experiment that is designed where none is named. */
  get beganAsUsual(): boolean {
    return this.opened === USUAL_LENS;
  }

  get canUndo(): boolean {
    return this.at > 0;
  }

  get canRedo(): boolean {
    return this.at + 1 < this.steps.length;
  }

  /** Reads what the studio was started with, and what this tab held before it was loaded again. */
  async start(): Promise<First> {
    this.about = (await (await fetch("state")).json()) as State;
    server.connect();
    const kept = this.#kept();
    const first = this.about.opened[0];
    this.#named = first?.toml;
    if (kept) this.#take(kept);
    // Started with another lens than before: that one is shown, and the tab's own stays within reach.
    if (first && first.toml !== kept?.named) this.open(first);
    return this.about.first;
  }

  #take({ steps, at, before, saved, savedAs, opened = "" }: Kept): void {
    this.#history += 1;
    this.steps = steps;
    this.at = at;
    this.before = before;
    this.saved = saved;
    this.savedAs = savedAs;
    this.opened = opened;
    this.dragged = [];
    this.maxFrequency = undefined;
    this.outOfFocus = undefined;
    this.#keep();
    this.refresh();
  }

  /** Opens a lens: a new history begins. Changes that no file holds can be gone back to. */
  open({ name, toml, losses }: Opened): void {
    const left = this.toml === this.saved ? undefined : this.#present();
    const title = this.view?.name;
    this.#history += 1;
    this.steps = [{ toml, what: `open ${name}` }];
    this.at = 0;
    this.before = toml;
    this.saved = toml;
    this.savedAs = "";
    this.opened = name;
    this.dragged = [];
    this.maxFrequency = undefined;
    this.outOfFocus = undefined;
    this.notice = lossNotice(`${name}: what the lens does not represent of its file`, losses);
    if (left) {
      const action = {
        name: "Go back to it",
        run: () => {
          this.notice = undefined;
          this.#take(left);
        },
      };
      const { text, details } = this.notice ?? {};
      const unsaved = `the lens before${title ? `, ${title},` : ""} has changes that are not saved`;
      this.notice = { kind: "warning", text: text ? `${unsaved}; ${text}` : unsaved, action, ...(details ? { details } : {}) };
    }
    this.#keep();
    this.refresh();
  }

  /** Reads a lens by name or text, and opens it. */
  async load(name: string, lens: unknown): Promise<void> {
    try {
      const read = await server.call<{ text: string; losses_of_reading: Loss[] }>("lens-edit", { lens });
      this.open({ name, toml: read.text, losses: read.losses_of_reading });
    } catch (error) {
      if (!(error instanceof CallError)) throw error;
      // A text that is sent has no name at the server.
      this.notice = { kind: "error", text: error.text.replace(/lens \(inline\)(\.\w+)?/, name) };
    }
  }

  /** Shows a view that has these parts; everything if none are named. */
  see(view: View, parts: string[]): void {
    this.view = view;
    this.#computed = parts;
    if (this.selected > view.surfaces.length) this.selected = 0;
  }

  /** Why a part of the view has nothing to show. */
  whyEmpty(part: Part): string {
    if (this.#computed.length === 0 || this.#computed.includes(part)) return "no light reaches the image";
    return server.lost ? "not computed: the studio is not reached" : "not computed yet";
  }

  /** Notes whether a part of the view lies in the window. */
  sees(part: Part, isSeen: boolean): void {
    if (isSeen) this.#unseen.delete(part);
    else this.#unseen.add(part);
  }

  /**
   * Shows edits that are being dragged; the state stays. What lies outside of the window waits for the release. Rays come first; modulation and field
   * curves of a room that shows everything follow when they are there.
   */
  drag(edits: Edit[]): void {
    this.dragged = edits;
    const shown = (parts: Part[]) => parts.filter((part) => !this.#unseen.has(part) && (this.parts.length === 0 || this.parts.includes(part)));
    this.#follow(this.live, edits, ["layout", ...shown(["spots", "fans"])]);
    const slow = shown(["mtf", "field-curves"]);
    if (slow.length > 0) this.#follow(this.#slow, edits, slow);
  }

  /** Looks quickly at parts of the lens, and puts them into what is seen while the drag goes on. */
  #follow(channel: Live, edits: Edit[], parts: Part[]): void {
    clearTimeout(this.#rest);
    this.#exact.drop();
    const toml = this.toml;
    channel.send<View>({
      job: "lens-view",
      request: { ...this.#request(edits, true), parts },
      done: (view) => {
        if (toml === this.toml && this.dragged.length > 0 && this.view) this.view = joined(this.view, view, parts);
      },
      failed: (error) => this.#say(error),
    });
  }

  /** Ends a drag without a change. */
  release(): void {
    this.dragged = [];
    this.refresh();
  }

  /** Applies edits as one step that can be undone; false if the lens refuses them. Edits wait for those before them. */
  commit(edits: Edit[], what: string): Promise<boolean> {
    this.live.drop();
    return this.#inTurn(() => this.#apply(edits, what));
  }

  /** Waits for the edits that are on their way. */
  async settled(): Promise<void> {
    await this.#commits;
  }

  /** Does something after the edits that are on their way. */
  #inTurn(what: () => boolean | Promise<boolean>): Promise<boolean> {
    const done = this.#commits.then(what);
    // What fails unexpectedly fails alone.
    this.#commits = done.catch(() => false);
    return done;
  }

  async #apply(edits: Edit[], what: string): Promise<boolean> {
    const history = this.#history;
    try {
      for (;;) {
        // A channel of its own: a drag that goes on must not take the place of the step.
        const toml = this.toml;
        const { parts } = this;
        const view = await server.call<View>("lens-view", this.#request(edits, true), { live: "commit" });
        // Another lens was opened: the edits were none of it.
        if (history !== this.#history) return false;
        // An optimisation came back meanwhile: the edits go on top of it.
        if (toml !== this.toml) continue;
        this.dragged = [];
        this.notice = undefined;
        if (view.toml !== this.toml) this.push(view.toml, what);
        this.see(view, parts);
        this.#exactLater();
        return true;
      }
    } catch (error) {
      if (history !== this.#history) return false;
      this.dragged = [];
      this.#say(error);
      this.refresh();
      return false;
    }
  }

  /** Adds a state. What was undone before is forgotten. */
  push(toml: string, what: string): void {
    this.steps = [...this.steps.slice(0, this.at + 1), { toml, what }].slice(-MOST_STEPS);
    this.at = this.steps.length - 1;
    this.#keep();
  }

  /** Takes the last step back. Edits that are on their way come first: what was done last is undone first. */
  undo(): void {
    void this.#inTurn(() => this.#go(this.at - 1));
  }

  redo(): void {
    void this.#inTurn(() => this.#go(this.at + 1));
  }

  #go(to: number): boolean {
    if (to < 0 || to >= this.steps.length) return false;
    this.at = to;
    this.dragged = [];
    this.notice = undefined;
    this.#keep();
    this.refresh();
    return true;
  }

  /** Looks at no more than a room shows; everything if no parts are named. */
  show(parts: string[]): void {
    if (JSON.stringify(parts) === JSON.stringify(this.parts)) return;
    this.parts = parts;
    if (this.toml) this.refresh();
  }

  /** Looks at the present state: quickly at once, exactly after a rest. */
  refresh(): void {
    this.#look([], true);
  }

  #look(edits: Edit[], quick: boolean): void {
    clearTimeout(this.#rest);
    this.#exact.drop();
    const { toml, parts } = this;
    const channel = quick ? this.live : this.#exact;
    channel.send<View>({
      job: "lens-view",
      request: this.#request(edits, quick),
      done: (view, warnings) => {
        // The lens may have moved on meanwhile.
        if (toml !== this.toml || (edits.length > 0) !== (this.dragged.length > 0)) return;
        if (!view.is_quick) {
          this.difference = differenceOf(this.view, view);
          this.outOfFocus = view.out_of_focus ?? undefined;
        }
        this.see(view, parts);
        this.warnings = warnings;
        this.maxFrequency ??= view.mtf[0]?.frequency_per_mm.at(-1);
        if (quick && edits.length === 0) this.#exactLater();
      },
      failed: (error) => this.#say(error),
    });
  }

  #exactLater(): void {
    clearTimeout(this.#rest);
    this.#rest = setTimeout(() => {
      if (this.dragged.length === 0) this.#look([], false);
    }, REST_MS);
  }

  #request(edits: Edit[], quick: boolean): object {
    const limits = Object.fromEntries(Object.entries(this.limits).filter(([, value]) => Number.isFinite(value)));
    return { lens: { toml: this.toml }, edits, quick, parts: this.parts, goal: limits, max_frequency: this.maxFrequency };
  }

  #say(error: unknown): void {
    if (error instanceof CallError) this.notice = { kind: "error", text: error.text };
    else throw error;
  }

  /** Keeps the states for this tab; a browser that is out of room keeps the last ones. */
  #keep(): void {
    for (const count of [MOST_STEPS, 50, 5]) {
      const from = Math.max(0, this.steps.length - count);
      const kept = { ...this.#present(), steps: this.steps.slice(from), at: this.at - from };
      if (kept.at < 0) continue;
      try {
        sessionStorage.setItem(STORE, JSON.stringify(kept));
        return;
      } catch {
        // The next try keeps fewer.
      }
    }
  }

  #present(): Kept {
    const { steps, at, before, saved, savedAs, opened } = this;
    return { steps, at, before, saved, savedAs, opened, ...(this.#named === undefined ? {} : { named: this.#named }) };
  }

  #kept(): Kept | undefined {
    try {
      const kept = JSON.parse(sessionStorage.getItem(STORE) ?? "null");
      return kept?.steps?.[kept.at]?.toml ? kept : undefined;
    } catch {
      return undefined;
    }
  }

  /** Notes that the present state stands in a file. */
  markSaved(path: string): void {
    this.saved = this.toml;
    this.savedAs = path;
    this.#keep();
  }
}

/** The largest difference of the RMS spots of a quick and an exact view of one lens, of the largest spot. */
function differenceOf(quick: View | undefined, exact: View): number | undefined {
  if (!quick?.is_quick || quick.toml !== exact.toml || quick.spots.length !== exact.spots.length) return undefined;
  const largest = Math.max(...exact.spots.map((spot) => spot.rms_um));
  const apart = Math.max(...exact.spots.map((spot, i) => Math.abs(spot.rms_um - quick.spots[i]!.rms_um)));
  return largest > 0 ? apart / largest : undefined;
}

/** What is to be said of losses; nothing if there are none. */
export function lossNotice(text: string, losses: Loss[]): Notice | undefined {
  if (losses.length === 0) return undefined;
  const line = ({ line, record, message, more }: Loss) =>
    `${line === null ? "" : `line ${line}: `}${record}: ${message}${more > 0 ? ` (and ${more} more)` : ""}`;
  return { kind: "info", text, details: losses.map(line) };
}

export const session = new Session();

/** A path as the studio's folder names it: stores give theirs from the root of the file system on. */
export function inFolder(path: string): string {
  return below(path, session.about?.folder ?? "");
}
