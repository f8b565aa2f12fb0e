// How quickly the studio follows a drag: `npm run measure`. It drags the curvature of the first surface for some seconds in each room, and prints
// answers a second and their times from the sending of a state until its picture is on the screen's canvas.

import { forget, startBrowser, startStudio } from "./browser.mjs";

const SECONDS = Number(process.argv[2] ?? 8);

const studio = await startStudio(process.argv.slice(3));
const browser = await startBrowser();
const page = await (await browser.newContext({ viewport: { width: 1440, height: 1000 } })).newPage();
await page.goto(studio.url);

/** Drags back and forth, with a move about every 8 ms. */
async function drag() {
  const handle = page.getByRole("slider", { name: "curvature of surface 1", exact: true });
  await handle.waitFor();
  const box = await handle.boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.evaluate(() => performance.clearMeasures());
  const began = performance.now();
  for (let i = 0; performance.now() - began < 1000 * SECONDS; i++) {
    await page.mouse.move(x + 6 * Math.sin(i / 15), y);
    await new Promise((done) => setTimeout(done, 8));
  }
  const seconds = (performance.now() - began) / 1000;
  const measured = await page.evaluate(() => performance.getEntriesByType("measure").map(({ name, duration }) => ({ name, duration })));
  await page.keyboard.press("Escape");
  await page.mouse.up();
  return { seconds, measured };
}

function report(room, { seconds, measured }) {
  for (const name of new Set(measured.map((m) => m.name))) {
    const times = measured.filter((m) => m.name === name).map((m) => m.duration).sort((a, b) => a - b);
    const at = (share) => times[Math.min(Math.floor(share * times.length), times.length - 1)].toFixed(1);
    console.log(`${room}, ${name}: ${(times.length / seconds).toFixed(1)} a second; p50 ${at(0.5)} ms, p95 ${at(0.95)} ms, ${times.length} answers`);
  }
}

await page.getByTestId("accuracy").filter({ hasText: "exact" }).first().waitFor();
report("lens room", await drag());
await page.getByRole("navigation", { name: "Rooms" }).getByRole("button", { name: "Camera", exact: true }).click();
await page.getByTestId("chain").filter({ hasText: "exact:" }).waitFor({ timeout: 120_000 });
report("camera room", await drag());
await browser.close();
await studio.stop();
forget(studio.folder);
