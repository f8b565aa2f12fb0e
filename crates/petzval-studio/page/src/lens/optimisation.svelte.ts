// An optimisation of the lens that is worked on. It goes on while one is in another room.

import { CallError, server, type Running } from "../lib/server.svelte";
import { meanRms } from "../lib/numbers";
import { session } from "../lib/session.svelte";
import type { JobEvent, View } from "../lib/types";
import { holdsPower } from "./freedom";

interface Found {
  found: { start: { mean_rms_um: number } | null; best: { mean_rms_um: number }; lens: string };
}

class Optimisation {
  iterations = $state(200);
  running = $state.raw<Running<Found> | undefined>();
  history = $state.raw<{ step: number; rms_um: number }[]>([]);
  says = $state("");
  progress = $state.raw<{ done: number; total: number } | undefined>();
  /** The best lens of an optimisation during which the lens was changed. */
  offered = $state.raw<string | undefined>();
  rewound = $state<number | undefined>();
  /** Files of the lenses on the way, for going back to one. */
  lenses = $state.raw<string[]>([]);
  /** The lens that it found, or a step of it that was gone back to. */
  shown = $state.raw("");
  /** The surfaces whose radii held a focal length or a magnification before it began. */
  solved = $state.raw<number[]>([]);
  /** The lens that it began with. */
  #begun = "";

  #limits(): object {
    return Object.fromEntries(Object.entries(session.limits).filter(([, value]) => Number.isFinite(value)));
  }

  /** Looks at the newest better lens; those that came meanwhile are left out. */
  #show(path: string): void {
    this.lenses = [...this.lenses, path];
    const step = this.lenses.length;
    // A lens that was changed meanwhile is the one to be seen.
    if (session.toml !== this.#begun) return;
    const { parts } = session;
    session.live.send<View>({
      job: "lens-view",
      request: { lens: path, quick: true, parts, goal: this.#limits(), max_frequency: session.maxFrequency },
      done: (view) => {
        if (!this.running || session.toml !== this.#begun) return;
        session.see(view, parts);
        const rms_um = meanRms(view.spots);
        if (rms_um !== undefined) this.history = [...this.history, { step, rms_um }];
      },
    });
  }

  #hear(event: JobEvent): void {
    if (event.event === "progress") this.progress = { done: event.done, total: event.total };
    else if (event.event === "note") this.says = event.text.trim();
    else if (event.event === "file" && event.what === "lens" && event.path.includes("step-")) this.#show(event.path);
  }

  async start(): Promise<void> {
    await session.settled();
    const begun = session.toml;
    this.#begun = begun;
    this.solved = session.view?.surfaces.filter(holdsPower).map(({ surface }) => surface) ?? [];
    const time = new Date().toISOString().replace(/\.\d+Z$/, "").replaceAll(":", "-");
    const out = `studio-optimised/${time}`;
    this.history = [];
    this.lenses = [];
    this.offered = undefined;
    this.rewound = undefined;
    this.says = "starting";
    this.progress = undefined;
    session.notice = undefined;
    const request = { start: { new: { lens: { toml: begun }, out, goal: this.#limits() } }, iterations: this.iterations };
    this.running = server.run<Found>("lens-optimize", request, { onEvent: (event) => this.#hear(event) });
    let best: string | undefined;
    try {
      best = (await this.running.response).found.lens;
    } catch (error) {
      if (!(error instanceof CallError)) throw error;
      // A cancelled optimisation keeps the best lens so far.
      best = (error.report.stopped?.response as Found | undefined)?.found.lens;
      if (!best && error.report.kind !== "stopped") session.notice = { kind: "error", text: error.text };
    }
    this.running = undefined;
    this.progress = undefined;
    if (best) await this.#take(best, begun);
    else session.refresh();
  }

  cancel(): void {
    this.running?.cancel();
  }

  /** Makes the best lens one step that can be undone, unless the lens has changed meanwhile. */
  async #take(path: string, begun: string): Promise<void> {
    try {
      const { text } = await server.call<{ text: string }>("lens-edit", { lens: path });
      if (session.toml === begun) {
        this.shown = text;
        if (text !== begun) session.push(text, "optimise");
      } else {
        this.offered = text;
      }
    } catch (error) {
      if (!(error instanceof CallError)) throw error;
      session.notice = { kind: "error", text: error.text };
    }
    session.refresh();
  }

  /** Takes the lens that was found although the lens was changed meanwhile. */
  accept(): void {
    if (this.offered === undefined) return;
    this.shown = this.offered;
    session.push(this.offered, "optimise");
    this.offered = undefined;
    session.refresh();
  }

  async rewind(index: number): Promise<void> {
    const path = this.lenses[index - 1];
    if (!path || this.running) return;
    this.rewound = index;
    try {
      const { text } = await server.call<{ text: string }>("lens-edit", { lens: path });
      this.shown = text;
      session.push(text, `rewind to step ${index}`);
      session.refresh();
    } catch (error) {
      if (!(error instanceof CallError)) throw error;
      session.notice = { kind: "error", text: error.text };
    }
  }
}

export const optimisation = new Optimisation();
