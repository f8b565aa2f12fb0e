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

export class Form {
  schema = $state.raw<Schema | undefined>();
  config = $state.raw<Config | undefined>();
  /** What differs from the file, by key. */
  set = $state.raw<Record<string, unknown>>({});
  /** What is wrong, by key; under the empty key what belongs to none. */
  wrong = $state.raw<Record<string, string>>({});
  look = $state.raw<Look | undefined>();
  isLooking = $state(false);
  out = $state("");

  #number = 0;

  constructor(readonly experiment: string) {
    void server.call<Schema>("schema", { kind: "experiment" }).then((schema) => (this.schema = schema));
    void this.#read({});
  }

  /** The run as a request names it. */
  get run(): object {
    return { experiment: this.experiment, ...(this.out ? { out: this.out } : {}), changes: { set: this.set } };
  }

  /** Sets a key. A value that is refused is shown with the reason, and the experiment stays as it was. */
  async change(key: string, value: unknown): Promise<void> {
    const { [key]: _before, ...rest } = this.set;
    await this.#read(value === undefined ? rest : { ...rest, [key]: value }, key);
  }

  /** Takes a change back. */
  reset(key: string): Promise<void> {
    return this.change(key, undefined);
  }

  async #read(set: Record<string, unknown>, key = ""): Promise<void> {
    const number = ++this.#number;
    try {
      const run = { experiment: this.experiment, changes: { set } };
      const config = await server.call<Config>("design-config", { run });
      if (number !== this.#number) return;
      this.config = config;
      this.set = set;
      this.wrong = {};
      this.look = undefined;
      if (!this.out) this.out = free(config);
    } catch (error) {
      if (!(error instanceof CallError)) throw error;
      if (number === this.#number) this.wrong = { ...this.wrong, [this.#keyOf(error, key)]: error.text };
    }
  }

  /** The key that an error is about: the one it names, or the one that was changed. */
  #keyOf({ report }: CallError, key: string): string {
    const named = report.place?.value?.split("=")[0] ?? "";
    const place = report.place?.key ?? "";
    return [named, place].find((name) => name.includes(".")) ?? key;
  }

  /** Looks at the experiment as before its first step. */
  async check(): Promise<boolean> {
    this.isLooking = true;
    let isFine = false;
    try {
      this.look = await server.call<Look>("design-check", { run: this.run });
      this.wrong = {};
      isFine = this.look.problems.length === 0;
    } catch (error) {
      if (!(error instanceof CallError)) throw error;
      this.wrong = { ...this.wrong, [this.#keyOf(error, "")]: error.text };
    }
    this.isLooking = false;
    return isFine;
  }
}

/** A folder for a run that holds none yet. */
function free({ folder, is_taken }: Config): string {
  if (!is_taken) return folder;
  return `${folder}-${new Date().toISOString().slice(0, 19).replaceAll(":", "-")}`;
}
