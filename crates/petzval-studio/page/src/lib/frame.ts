// What is to be shown waits for the next frame of the window: however many answers come until then, the page is drawn once.

import { flushSync } from "svelte";

/** Milliseconds after which it is shown without a frame: a window that is hidden has none. */
const AT_LATEST_MS = 150;

interface Shown {
  show: () => void;
  after: () => void;
}

let waiting: Shown[] = [];
let frame: number | undefined;
let latest: ReturnType<typeof setTimeout> | undefined;

/** Shows something in the next frame; `after` is called when it stands on the page. */
export function inFrame(show: () => void, after: () => void): void {
  waiting.push({ show, after });
  if (frame !== undefined) return;
  frame = requestAnimationFrame(showAll);
  latest = setTimeout(showAll, AT_LATEST_MS);
}

function showAll(): void {
  if (frame !== undefined) cancelAnimationFrame(frame);
  clearTimeout(latest);
  frame = undefined;
  const all = waiting;
  waiting = [];
  flushSync(() => {
    for (const { show } of all) {
      try {
        show();
      } catch (error) {
        // A fault of the page is one of this answer: the others are shown.
        reportError(error);
      }
    }
  });
  for (const { after } of all) after();
}
