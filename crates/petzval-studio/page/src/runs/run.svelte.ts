// A run that is looked at again and again while it is at work.

import { CallError, server } from "../lib/server.svelte";
import type { RunStep, RunView } from "../lib/types";

/** Milliseconds between two looks at a run at work, and at one at rest. */
const AT_WORK_MS = 1000;
const AT_REST_MS = 4000;

export class WatchedRun {
  view = $state.raw<RunView | undefined>();
  /** Every step so far. */
  steps = $state.raw<RunStep[]>([]);
  wrong = $state("");

  #timer: ReturnType<typeof setTimeout> | undefined;
  #isOver = false;
  #isLooking = false;
  #isDue = false;

  constructor(readonly run: string) {
    void this.#look();
  }

  /** Looks now, and on; if a look is in flight, as soon as it is back. */
  again(): void {
    clearTimeout(this.#timer);
    if (this.#isLooking) this.#isDue = true;
    else void this.#look();
  }

  end(): void {
    this.#isOver = true;
    clearTimeout(this.#timer);
  }

  async #look(): Promise<void> {
    this.#isLooking = true;
    try {
      const after = this.steps.at(-1)?.step ?? 0;
      const view = await server.call<RunView>("run-view", { run: this.run, after });
      if (this.#isOver) return;
      // A run that goes on from a checkpoint takes steps again; of a long one, fewer are given.
      const isOther = view.row.step < after || (this.view && view.every !== this.view.every);
      if (isOther) this.steps = [];
      else if (view.steps.length > 0) this.steps = [...this.steps, ...view.steps];
      this.view = view;
      this.wrong = "";
      if (isOther) this.#isDue = true;
    } catch (error) {
      if (!(error instanceof CallError)) throw error;
      this.wrong = error.text;
    }
    this.#isLooking = false;
    const isDue = this.#isDue;
    this.#isDue = false;
    if (isDue && !this.#isOver) return this.again();
    if (!this.#isOver) this.#timer = setTimeout(() => void this.#look(), this.view?.row.state === "running" ? AT_WORK_MS : AT_REST_MS);
  }
}
