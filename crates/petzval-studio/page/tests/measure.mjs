// How quickly the studio follows a drag: `npm run measure`. It drags the curvature of the first surface for some seconds in each room, and prints
// answers a second, their times from the sending of a state until it stands on the page, and what CPU time an answer took in each process: on a
// machine that others use, that is the figure to look at.

import { readFileSync, readdirSync } from "node:fs";
import { forget, startStudio } from "./browser.mjs";
import { openWindow } from "./devtools.mjs";

const SECONDS = Number(process.argv[2] ?? 8);

/** Ticks of the clock in a second, by which Linux counts CPU time. */
const TICKS = 100;

const studio = await startStudio(process.argv.slice(3));
const page = await openWindow(studio.url, 1440, 1000);

/** CPU time of this process and of all below it, ms, by what they are. */
function cpuTimes() {
  const processes = new Map();
  for (const pid of readdirSync("/proc").filter((name) => /^\d+$/.test(name))) {
    try {
      const stat = readFileSync(`/proc/${pid}/stat`, "latin1");
      const fields = stat.slice(stat.lastIndexOf(")") + 2).split(" ");
      // The children of chromium write their words as one.
      const words = readFileSync(`/proc/${pid}/cmdline`, "latin1").split(/[\0 ]/);
      processes.set(Number(pid), { parent: Number(fields[1]), ms: ((Number(fields[11]) + Number(fields[12])) * 1000) / TICKS, words });
    } catch {
      // It has ended.
    }
  }
  const isOurs = (pid) => pid === process.pid || (processes.has(pid) && isOurs(processes.get(pid).parent));
  const times = {};
  for (const [pid, { ms, words }] of processes) {
    if (!isOurs(pid)) continue;
    const kind = words.find((word) => word.startsWith("--type="))?.slice("--type=".length);
    const name = pid === process.pid ? "this script" : pid === studio.pid ? "studio" : (kind ?? "browser");
    times[name] = (times[name] ?? 0) + ms;
  }
  return times;
}

/** Drags back and forth, with a move about every 8 ms. */
async function drag() {
  const handle = `document.querySelector('[aria-label="curvature of surface 1"] .mark')`;
  await page.until(handle);
  const [x, y] = await page.evaluate(`(() => { const box = ${handle}.getBoundingClientRect(); return [box.x + box.width / 2, box.y + box.height / 2]; })()`);
  await page.mouse("mouseMoved", x, y, 0);
  await page.mouse("mousePressed", x, y, 1);
  await page.evaluate("performance.clearMeasures()");
  const [before, began] = [cpuTimes(), performance.now()];
  for (let i = 0; performance.now() - began < 1000 * SECONDS; i++) {
    await page.mouse("mouseMoved", x + 6 * Math.sin(i / 15), y, 1);
    await new Promise((done) => setTimeout(done, 8));
  }
  const [after, seconds] = [cpuTimes(), (performance.now() - began) / 1000];
  const measured = await page.evaluate("performance.getEntriesByType('measure').map(({ name, duration }) => ({ name, duration }))");
  const cpu = Object.entries(after).map(([name, ms]) => [name, ms - (before[name] ?? 0)]);
  await page.press("Escape");
  await page.mouse("mouseReleased", x, y, 0);
  return { seconds, measured, cpu };
}

function report(room, channel, { seconds, measured, cpu }) {
  for (const name of new Set(measured.map((m) => m.name))) {
    const times = measured.filter((m) => m.name === name).map((m) => m.duration).sort((a, b) => a - b);
    const at = (share) => times[Math.min(Math.floor(share * times.length), times.length - 1)].toFixed(1);
    console.log(`${room}, ${name}: ${(times.length / seconds).toFixed(1)} a second; p50 ${at(0.5)} ms, p95 ${at(0.95)} ms, ${times.length} answers`);
  }
  const count = Math.max(measured.filter((m) => m.name === channel).length, 1);
  const each = (ms) => (ms / count).toFixed(1);
  const all = cpu.reduce((sum, [, ms]) => sum + ms, 0);
  const parts = cpu.filter(([, ms]) => ms > 0).map(([name, ms]) => `${name} ${each(ms)}`);
  console.log(`${room}: ${each(all)} ms of CPU for each answer of ${channel}: ${parts.join(", ")}`);
}

await page.until(`document.querySelector('[data-testid="accuracy"]')?.textContent.includes("exact")`);
report("lens room", "live lens", await drag());
await page.evaluate(`[...document.querySelectorAll("nav button")].find((button) => button.textContent === "Camera").click()`);
await page.until(`document.querySelector('[data-testid="chain"]')?.textContent.includes("exact:")`);
report("camera room", "live camera", await drag());
await page.close();
await studio.stop();
forget(studio.folder);
