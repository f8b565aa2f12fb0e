// The log of a process that a call began: what it says, and how it ended.

import { fileUrl } from "../lib/paths";
import { inPage } from "../lib/server.svelte";

/** What a log says so far. */
export interface Said {
  /** Notes, warnings and progress, as texts. */
  notes: string[];
  /** Whether the process has taken a step. */
  isAtWork: boolean;
  /** Why it has failed. */
  wrong?: string;
  /** Whether it has ended. */
  isOver: boolean;
}

interface Line {
  event: string;
  text?: string;
  message?: string;
  hint?: string;
  /** How it ended; null of a process that was killed. */
  code?: number | null;
}

/** Reads a log. One that cannot be read says nothing yet. */
export async function readLog(log: string): Promise<Said> {
  const answer = await fetch(fileUrl(log)).catch(() => undefined);
  const texts = answer?.ok ? (await answer.text()).split("\n").filter((text) => text.trim() !== "") : [];
  return said(texts);
}

function said(texts: string[]): Said {
  const lines = texts.flatMap((text) => {
    try {
      return [JSON.parse(text) as Line];
    } catch {
      return [];
    }
  });
  const notes = lines.flatMap(({ event, text }) => (text && ["note", "warning", "progress"].includes(event) ? [text] : []));
  const isAtWork = lines.some(({ event }) => event === "step");
  const failed = lines.find(({ event }) => event === "error");
  const ended = lines.find(({ event }) => event === "ended");
  const isOver = ended !== undefined;
  if (failed) {
    const message = failed.message ?? "the process has failed";
    return { notes, isAtWork, isOver, wrong: inPage(failed.hint ? `${message} (${failed.hint})` : message) };
  }
  if (ended && ended.code !== 0) {
    // What a process says before it breaks down is no event.
    const last = texts.filter((text) => !text.startsWith("{")).slice(-3);
    const how = ended.code === null ? "the process was killed" : `the process ended with the code ${ended.code}`;
    return { notes, isAtWork, isOver, wrong: [how, ...last].join(": ") };
  }
  return { notes, isAtWork, isOver };
}
