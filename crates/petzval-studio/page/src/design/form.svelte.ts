// An experiment that is being changed: its values, what differs from its file, and what is wrong.

import { CallError, server } from "../lib/server.svelte";
import type { Schema } from "./schema";

interface Config {
  title: string;
  values: Record<string, unknown>;
  text: string;
  folder: string;
  is_taken: boolean;
}

/** What the job `design-check` finds. */
export interface Look {
  steps: number;
  problems: string[];
  warnings: string[];
  photos: { training: number; held_out: number; window: number } | null;
  lenses: { lens: string; cameras: string[]; efl_mm: number; f_number: number; image_circle_mm: number; violated: string[]; fields: { field_deg: number; rms_spot_um: number; light_on_grid: number }[] }[];
}

/** What a tab holds of a form, also when it is loaded again. */
interface Kept {
  set: Record<string, unknown>;
  out: string;
}

/** Where the forms are kept, by experiment. */
const STORE = "petzval-studio-forms";

function keptForms(): Record<string, Kept> {
  try {
    return JSON.parse(sessionStorage.getItem(STORE) ?? "{}") as Record<string, Kept>;
  } catch {
    return {};
  }
}

/** Whether a form of this tab differs from its experiment. */
export const isAnyChanged = () => Object.values(keptForms()).some(({ set }) => Object.keys(set).length > 0);

export class Form {
  schema = $state.raw<Schema | undefined>();
  config = $state.raw<Config | undefined>();
  /** What differs from the file, by key. */
  set = $state.raw<Record<string, unknown>>({});
  /** What was refused, by the key that was changed; under the empty key what belongs to none. */
  #refused = $state.raw<Record<string, { at: string; text: string }>>({});
  look = $state.raw<Look | undefined>();
  isLooking = $state(false);
  out = $state("");

  #changes: Promise<void>;

  /** `lens` is the text of a lens to which the usual experiment is fitted, in place of the named one. */
  constructor(
    readonly experiment: string,
    readonly lens?: string,
  ) {
    void server.call<Schema>("schema", { kind: "experiment" }).then((schema) => (this.schema = schema));
    this.#changes = this.#begin(keptForms()[experiment]);
  }

  /** Takes what the tab holds of the form. */
  async #begin(kept: Kept = { set: {}, out: "" }): Promise<void> {
    await this.#read(kept.set);
    // The experiment, or the lens that it is fitted to, has become another one: the form shows it, and why the changes do not fit.
    if (!this.config && Object.keys(kept.set).length > 0) {
      const refused = this.#refused;
      await this.#read({});
      if (this.config) this.#refused = refused;
    }
    if (!this.config || !kept.out) return;
    this.out = kept.out;
    if (await this.isTaken()) this.out = free(this.config);
  }

  /** Keeps the form for this tab. */
  keep(): void {
    if (this.config) sessionStorage.setItem(STORE, JSON.stringify({ ...keptForms(), [this.experiment]: { set: this.set, out: this.out } }));
  }

  /** Waits for the changes that are on their way. */
  async settled(): Promise<void> {
    await this.#changes;
  }

  /** What is wrong, by the key beside which it is said. */
  get wrong(): Record<string, string> {
    return Object.fromEntries(Object.values(this.#refused).map(({ at, text }) => [at, text]));
  }

  /** Whether a value stands on the screen that the experiment does not have. */
  get isRefused(): boolean {
    return Object.keys(this.#refused).some((key) => key !== "");
  }

  /** The experiment as a request names it. */
  get #named(): string | { toml: string } {
    return this.lens === undefined ? this.experiment : { toml: this.lens };
  }

  /** The run as a request names it. */
  get run(): object {
    return { experiment: this.#named, ...(this.out ? { out: this.out } : {}), changes: { set: this.set } };
  }

  /**
   * Sets a key. A value that is refused is shown with the reason, and the experiment stays as it was. Changes wait for those before them: each
   * builds on what they left.
   */
  change(key: string, value: unknown): Promise<void> {
    const changed = this.#changes.then(() => {
      const { [key]: _before, ...rest } = this.set;
      return this.#read(value === undefined ? rest : { ...rest, [key]: value }, key);
    });
    this.#changes = changed.catch(() => {});
    return changed;
  }

  /** Takes a change back. */
  reset(key: string): Promise<void> {
    return this.change(key, undefined);
  }

  /** Notes why the value of a key is not taken. */
  refuse(key: string, text: string, at = key): void {
    this.#refused = { ...this.#refused, [key]: { at, text } };
  }

  /** Forgets why the values of keys were not taken. */
  #accept(...keys: string[]): void {
    this.#refused = Object.fromEntries(Object.entries(this.#refused).filter(([key]) => !keys.includes(key)));
  }

  async #read(set: Record<string, unknown>, key = ""): Promise<void> {
    try {
      const run = { experiment: this.#named, changes: { set } };
      const config = await server.call<Config>("design-config", { run });
      this.config = config;
      this.set = set;
      // Other values that were refused stand on the screen still, and so do their reasons.
      this.#accept(key, "");
      this.look = undefined;
      if (!this.out) this.out = free(config);
    } catch (error) {
      if (!(error instanceof CallError)) throw error;
      // Beside its field a value needs no place.
      this.refuse(key, key ? error.plain : error.text, this.#keyOf(error, key));
    }
  }

  /** The key that an error is about: the one it names, or the one that was changed. */
  #keyOf({ report }: CallError, key: string): string {
    const named = report.place?.value?.split("=")[0] ?? "";
    const place = report.place?.key ?? "";
    return [named, place].find((name) => name.includes(".")) ?? key;
  }

  /** The folder of the run: the one that is named, or that of the experiment. */
  get folder(): string {
    return this.out || this.config?.folder || "";
  }

  /** Whether the folder of the run holds one already. */
  async isTaken(): Promise<boolean> {
    return (await server.call<Config>("design-config", { run: this.run })).is_taken;
  }

  /** Looks at the experiment as before its first step; once more if it was changed meanwhile. */
  async check(): Promise<void> {
    this.isLooking = true;
    let of: unknown;
    do {
      await this.settled();
      of = this.set;
      try {
        this.look = await server.call<Look>("design-check", { run: this.run });
        this.#accept("");
      } catch (error) {
        if (!(error instanceof CallError)) throw error;
        this.refuse("", error.text, this.#keyOf(error, ""));
      }
      await this.settled();
    } while (of !== this.set);
    this.isLooking = false;
  }
}

/** A folder for a run that holds none yet. */
function free({ folder, is_taken }: Config): string {
  if (!is_taken) return folder;
  return `${folder}-${new Date().toISOString().slice(0, 19).replaceAll(":", "-")}`;
}
