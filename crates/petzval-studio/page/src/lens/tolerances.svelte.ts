// The tolerances of the lens that is worked on. They go on while one is in another room.

import { CallError, server, type Running } from "../lib/server.svelte";
import { session } from "../lib/session.svelte";
import type { JobEvent } from "../lib/types";

export interface Sensitivity {
  name: string;
  unit: string;
  tolerance: number;
  merit_at_minus: number | null;
  merit_at_plus: number | null;
}

export interface Report {
  merit: string;
  unit: string;
  better: "lower" | "higher";
  nominal: number;
  sensitivities: Sensitivity[];
  monte_carlo: {
    trials: number;
    failed: number;
    mean: number | null;
    standard_deviation: number | null;
    percentiles: { percent: number; merit: number | null }[];
    limit: number | null;
    yield_at_limit: number | null;
    worst: { trial: number; merit: number | null }[];
    yield_curve: [number, number][];
  } | null;
}

interface Found {
  report: Report;
  files: string[];
}

class Tolerances {
  grade = $state<"commercial" | "precision" | "high">("precision");
  merit = $state<"rms" | "mtf">("rms");
  frequency = $state(40);
  trials = $state(200);
  /** A value of the merit that a lens must reach; none counts no lenses. */
  limit = $state<number | undefined>();
  running = $state.raw<Running<Found> | undefined>();
  says = $state("");
  progress = $state.raw<{ done: number; total: number } | undefined>();
  wrong = $state("");
  found = $state.raw<Found | undefined>();
  /** The lens that they belong to. */
  of = $state("");
  /** The folder of their files. */
  out = $state("");

  #hear(event: JobEvent): void {
    if (event.event !== "progress") return;
    this.progress = { done: event.done, total: event.total };
    this.says = event.text.trim();
  }

  async start(): Promise<void> {
    await session.settled();
    const begun = session.toml;
    const time = new Date().toISOString().replace(/\.\d+Z$/, "").replaceAll(":", "-");
    const out = `studio-tolerances/${time}`;
    this.wrong = "";
    this.says = "starting";
    this.progress = undefined;
    const { grade, merit, frequency, trials, limit } = this;
    const request = { lens: { toml: begun }, grade, merit, frequency, trials, out, ...(limit === undefined ? {} : { limit }) };
    const running = server.run<Found>("lens-tolerance", request, { onEvent: (event) => this.#hear(event) });
    this.running = running;
    try {
      this.found = await running.response;
      this.of = begun;
      this.out = out;
    } catch (error) {
      if (!(error instanceof CallError)) throw error;
      if (error.report.kind !== "stopped") this.wrong = error.text;
    }
    this.running = undefined;
    this.progress = undefined;
  }

  cancel(): void {
    this.running?.cancel();
  }

  /** The file of a lens that is among the worst. */
  file(trial: number): string | undefined {
    return this.found?.files.find((path) => new RegExp(`lens-0*${trial}\\.toml$`).test(path));
  }

  /** Shows one of the worst lenses as a step that can be undone. */
  async open(trial: number): Promise<void> {
    const path = this.file(trial);
    if (!path) return;
    try {
      const { text } = await server.call<{ text: string }>("lens-edit", { lens: path });
      session.push(text, `lens ${trial} of the tolerances`);
      session.refresh();
    } catch (error) {
      if (!(error instanceof CallError)) throw error;
      this.wrong = error.text;
    }
  }
}

export const tolerances = new Tolerances();
