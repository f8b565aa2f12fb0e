// The studio in a browser: every test opens it anew. `node tests/studio.mjs [FOLDER]` keeps the screenshots in a folder.
//
// Each step waits for what the page shows, never for a time.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { PETZVAL, forget, startBrowser, startStudio } from "./browser.mjs";

const pictures = process.argv[2] ?? mkdtempSync(join(tmpdir(), "petzval-studio-pictures-"));
mkdirSync(pictures, { recursive: true });

const WIDE = { width: 1440, height: 1000 };
const PHONE = { width: 390, height: 844 };

const browser = await startBrowser();
const tests = [];
const test = (name, run) => tests.push({ name, run });

/** A page of a studio, whose errors fail the test. */
async function open(studio, { viewport = WIDE, colorScheme = "light", context } = {}) {
  const owner = context ?? (await browser.newContext({ viewport, colorScheme, acceptDownloads: true }));
  const page = await owner.newPage();
  page.setDefaultTimeout(60_000);
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  await page.goto(studio.url);
  await page.getByLabel("radius of surface 1", { exact: true }).waitFor();
  return { page, owner, errors };
}

const radius = (page, surface = 1) => page.getByLabel(`radius of surface ${surface}`, { exact: true });
const exact = (page) => page.getByTestId("accuracy").filter({ hasText: "exact" }).first().waitFor();
const picture = (page, name, fullPage = true) => page.screenshot({ path: join(pictures, `${name}.png`), fullPage });
/** The lens as the tab keeps it. */
const toml = (page) =>
  page.evaluate(() => {
    const { steps, at } = JSON.parse(sessionStorage.getItem("petzval-studio"));
    return steps[at].toml;
  });

test("a lens is shown at once, with spots, MTF and layout", async (studio) => {
  const { page, errors } = await open(studio);
  assert.ok(!page.url().includes("token"), "the token does not stay in the address");
  await exact(page);
  assert.equal(await page.getByTestId("rms").count(), 4);
  assert.match(await page.getByTestId("rms").first().innerText(), /^[\d.]+ µm$/);
  assert.ok((await page.locator("svg .glass").count()) >= 3);
  assert.ok((await page.locator(".uplot canvas").count()) >= 4);
  const paint = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0]?.startTime);
  console.log(`   first paint after ${Math.round(paint)} ms`);
  assert.ok(paint < 1000, `first paint after ${paint} ms`);
  await picture(page, "lens-light");
  assert.deepEqual(errors, []);
});

test("an edit of the table, and undo to the bit by the keyboard alone", async (studio) => {
  const { page, errors } = await open(studio);
  const before = await toml(page);
  await radius(page).focus();
  await page.keyboard.type("25.5");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 1);
  assert.match(await toml(page), /radius_mm = 25\.5\n/);
  // Enter moved on to the next surface.
  assert.equal(await page.evaluate(() => document.activeElement.getAttribute("aria-label")), "radius of surface 2");
  await page.keyboard.press("Alt+ArrowUp");
  await page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 2);
  await page.keyboard.press("Alt+Insert");
  await page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 3);
  for (const at of [2, 1, 0]) {
    await page.keyboard.press("Control+z");
    await page.waitForFunction((at) => JSON.parse(sessionStorage.getItem("petzval-studio")).at === at, at);
  }
  assert.equal(await toml(page), before, "undo gives the first lens to the bit");
  await page.keyboard.press("Control+y");
  await page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 1);
  assert.match(await toml(page), /radius_mm = 25\.5\n/);
  // What makes no sense is refused, and the lens stays.
  await radius(page).focus();
  await page.keyboard.type("abc");
  await page.keyboard.press("Tab");
  await page.getByRole("alert").getByText("is no number").waitFor();
  assert.match(await toml(page), /radius_mm = 25\.5\n/);
  assert.deepEqual(errors, []);
});

test("a drag of a curvature moves the spots, and Escape and undo take it back", async (studio) => {
  const { page, errors } = await open(studio);
  await exact(page);
  const [before, rms] = [await toml(page), await page.getByTestId("rms").first().innerText()];
  const box = await page.getByRole("slider", { name: "curvature of surface 1", exact: true }).boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  for (let i = 1; i <= 12; i++) await page.mouse.move(x + i, y);
  await page.waitForFunction((rms) => document.querySelector("[data-testid=rms]")?.textContent !== rms, rms);
  await picture(page, "drag", false);
  assert.equal(await toml(page), before, "a drag alone is no step");
  await page.mouse.up();
  await page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 1);
  assert.notEqual(await toml(page), before);
  await page.getByRole("button", { name: "Undo" }).click();
  await page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 0);
  assert.equal(await toml(page), before);
  // The keyboard moves a handle as well.
  const handle = page.getByRole("slider", { name: "thickness in front of surface 2", exact: true });
  await handle.focus();
  await page.keyboard.press("ArrowRight");
  await page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 1);
  assert.deepEqual(errors, []);
});

test("a glass from the map", async (studio) => {
  const { page, errors } = await open(studio);
  await page.getByRole("button", { name: "choose the glass behind surface 1 from the map" }).click();
  await page.getByRole("list", { name: "Nearest glasses" }).getByRole("button").first().waitFor();
  await page.getByPlaceholder("part of a name").fill("N-SK16");
  await picture(page, "glass-map", false);
  await page.getByPlaceholder("part of a name").press("Enter");
  await page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 1);
  assert.match(await page.getByLabel("glass behind surface 1", { exact: true }).inputValue(), /N-SK16/);
  assert.deepEqual(errors, []);
});

test("an optimisation is one step, and a cancelled one keeps its best lens", async (studio) => {
  const { page, errors } = await open(studio);
  const before = await toml(page);
  await page.getByLabel("Iterations").fill("20");
  await page.getByRole("button", { name: "Optimise" }).click();
  await page.getByRole("button", { name: "Cancel" }).waitFor();
  await page.getByRole("button", { name: "Optimise" }).waitFor({ timeout: 120_000 });
  await page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 1);
  assert.notEqual(await toml(page), before);
  await picture(page, "optimised");
  await page.keyboard.press("Control+z");
  await page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 0);
  assert.equal(await toml(page), before, "one undo takes the whole optimisation back");
  await page.getByLabel("Iterations").fill("100000");
  await page.getByRole("button", { name: "Optimise" }).click();
  await page.getByRole("button", { name: "Cancel" }).click();
  await page.getByRole("button", { name: "Optimise" }).waitFor();
  assert.deepEqual(errors, []);
});

test("a dropped lens of another program is opened with what it loses, saved, and found again", async (studio) => {
  const { page, errors } = await open(studio);
  const zmx = [
    "VERS 190513 80 0",
    "MODE SEQ",
    "NAME Dropped singlet",
    "UNIT MM X W X CM MR CPMM",
    "ENPD 5",
    "FTYP 0 0 2 1 0 0 0",
    "XFLN 0 0",
    "YFLN 0 3",
    "WAVM 1 0.5876 1",
    "PWAV 1",
    "GCAT SCHOTT",
    "SURF 0",
    "  TYPE STANDARD",
    "  CURV 0.0",
    "  DISZ INFINITY",
    "SURF 1",
    "  STOP",
    "  TYPE STANDARD",
    "  CURV 0.02",
    "  COAT AR",
    "  DISZ 3",
    "  GLAS N-BK7 0 0 1.5168 64.17",
    "  DIAM 4 1 0 0 1",
    "SURF 2",
    "  TYPE STANDARD",
    "  CURV -0.02",
    "  DISZ 47",
    "  DIAM 4 1 0 0 1",
    "SURF 3",
    "  TYPE STANDARD",
    "  CURV 0",
    "  DISZ 0",
    "",
  ].join("\n");
  await page.evaluate((text) => {
    const transfer = new DataTransfer();
    transfer.items.add(new File([text], "singlet.zmx"));
    window.dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, cancelable: true, bubbles: true }));
  }, zmx);
  await page.waitForFunction(() => document.querySelector("input.name")?.value === "Dropped singlet");
  await page.getByText("what the lens does not represent of its file").waitFor();
  await page.getByText("COAT").first().waitFor();
  await page.keyboard.press("Control+s");
  const dialog = page.getByRole("dialog", { name: "Save the lens as" });
  await dialog.getByLabel("Name").fill("kept");
  await dialog.getByRole("button", { name: "Write into the folder" }).click();
  await page.getByText("written: kept.toml").waitFor();
  assert.equal(readFileSync(join(studio.folder, "kept.toml"), "utf8"), await toml(page));
  // A second time the file is there, and is overwritten on demand alone.
  await page.keyboard.press("Control+s");
  await dialog.getByRole("button", { name: "Write into the folder" }).click();
  await dialog.getByRole("alert").waitFor();
  await dialog.getByRole("button", { name: "Overwrite" }).click();
  await page.getByText("written: kept.toml").waitFor();
  await page.keyboard.press("Control+s");
  await dialog.getByLabel("Format").selectOption("seq");
  const [download] = await Promise.all([page.waitForEvent("download"), dialog.getByRole("button", { name: "Download" }).click()]);
  assert.equal(download.suggestedFilename(), "kept.seq");
  assert.deepEqual(errors, []);
});

test("the photograph follows: quick, then exact, with the difference, before and after, and raw", async (studio) => {
  const { page, errors } = await open(studio);
  await tab(page, "Camera").click();
  const chain = page.getByTestId("chain");
  await chain.filter({ hasText: "exact:" }).waitFor({ timeout: 120_000 });
  await chain.filter({ hasText: "the quick picture differed by" }).waitFor();
  const canvas = page.locator(".canvas canvas");
  assert.deepEqual(await canvas.evaluate((c) => [c.width, c.height]), [512, 512]);
  await picture(page, "camera-light");
  const pixels = () => canvas.evaluate((c) => c.toDataURL());
  const sharp = await pixels();
  // Out of focus: the picture changes, and the one before the edit comes back.
  await page.getByRole("slider", { name: "thickness in front of surface 2", exact: true }).focus();
  for (let i = 0; i < 5; i++) await page.keyboard.press("ArrowRight");
  await page.waitForFunction((before) => document.querySelector(".canvas canvas").toDataURL() !== before, sharp);
  await chain.filter({ hasText: "exact:" }).waitFor({ timeout: 120_000 });
  const blurred = await pixels();
  await page.getByRole("radio", { name: "Split" }).check();
  await page.waitForFunction((after) => document.querySelector(".canvas canvas").toDataURL() !== after, blurred, { timeout: 120_000 });
  await picture(page, "camera-split");
  await page.getByRole("radio", { name: "Raw" }).check();
  await page.waitForFunction(() => {
    const canvas = document.querySelector(".canvas canvas");
    const { data } = canvas.getContext("2d").getImageData(100, 100, 20, 20);
    return data.every((v, i) => i % 4 !== 1 || v === data[i - 1]);
  });
  await page.getByRole("radio", { name: "After" }).check();
  await page.getByLabel("Scene").selectOption("astronaut");
  await page.getByText("the photograph is enlarged").waitFor();
  // A place off the axis, by the keyboard.
  await page.getByRole("slider", { name: "Place on the sensor" }).focus();
  for (let i = 0; i < 6; i++) await page.keyboard.press("ArrowRight");
  await chain.filter({ hasText: "exact:" }).waitFor({ timeout: 120_000 });
  await picture(page, "camera-astronaut");
  assert.deepEqual(errors, []);
});

test("two tabs work on their own lenses", async (studio) => {
  const first = await open(studio);
  const second = await open(studio, { context: first.owner });
  await radius(first.page).fill("24");
  await radius(first.page).press("Enter");
  await first.page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 1);
  assert.equal(await second.page.evaluate(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at), 0);
  await radius(second.page).fill("23");
  await radius(second.page).press("Enter");
  await second.page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 1);
  assert.match(await toml(first.page), /radius_mm = 24\.0\n/);
  assert.deepEqual([...first.errors, ...second.errors], []);
});

test("the server is killed, and after its restart the tab goes on where it was", async (studio) => {
  const { page } = await open(studio);
  await radius(page).fill("24.25");
  await radius(page).press("Enter");
  await page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 1);
  const changed = await toml(page);
  await studio.stop("SIGKILL");
  await page.getByRole("alert").getByText("The studio is not reached").waitFor();
  const again = await startStudio(["--port", studio.port], studio.folder);
  try {
    page.on("dialog", (dialog) => dialog.accept());
    await page.goto(again.url);
    await exact(page);
    assert.equal(await toml(page), changed);
    await page.getByRole("button", { name: "Undo" }).click();
    await page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 0);
  } finally {
    await again.stop();
  }
});

test("dark, and as wide as a phone", async (studio) => {
  const dark = await open(studio, { colorScheme: "dark" });
  await exact(dark.page);
  const ground = await dark.page.evaluate(() => getComputedStyle(document.documentElement).backgroundColor);
  assert.equal(ground, "rgb(20, 23, 26)");
  await picture(dark.page, "lens-dark");
  const phone = await open(studio, { viewport: PHONE });
  await exact(phone.page);
  const wider = () => phone.page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok((await wider()) <= 0, "the lens room is wider than the phone");
  await picture(phone.page, "phone-lens");
  await tab(phone.page, "Camera").click();
  await phone.page.getByTestId("chain").filter({ hasText: "quick:" }).or(phone.page.getByTestId("chain").filter({ hasText: "exact:" })).waitFor();
  assert.ok((await wider()) <= 0, "the camera room is wider than the phone");
  await picture(phone.page, "phone-camera");
  assert.deepEqual([...dark.errors, ...phone.errors], []);
});

/** An experiment that runs in seconds, with steps in proportion to `steps`. */
function tiny(folder, steps) {
  const set = {
    "psf.fields": 3, "psf.grid": 64, "psf.scoring_pupil_error": 2, "psf.patches": "[2, 2]", "psf.pupil_cells": 16, "psf.scoring_pupil_cells": 16,
    "network.base_channels": 4, "network.levels": 1, "training.steps": steps, "training.batch": 1, "training.crop": 64, "optics.steps": 3,
    "spot.iterations": 8, "scoring.places_per_side": 1, "scoring.crop": 64, "checkpoint.every": 3,
  };
  const words = Object.entries(set).flatMap(([key, value]) => ["--set", `${key}=${value}`]);
  const text = execFileSync(PETZVAL, ["design", "cooke-triplet-image-quality", "--print-config", ...words], { cwd: folder });
  writeFileSync(join(folder, "tiny.toml"), text);
}

const tab = (page, name) => page.getByRole("navigation", { name: "Rooms" }).getByRole("button", { name, exact: true });

test("an experiment as a form, started, watched, stopped, and found again by the next studio", async (studio) => {
  tiny(studio.folder, 4000);
  const { page, errors } = await open(studio);
  await page.goto(`${new URL(studio.url).origin}/#design?experiment=tiny.toml`);
  await page.reload();
  const form = page.getByRole("region", { name: "Experiment", exact: true });
  await form.getByText("as in its file").waitFor();
  // A key that is refused says so beside it, and one that is taken is marked.
  await form.getByLabel("keys with the words").fill("training.batch");
  const batch = form.locator("[data-key='training.batch'] input");
  await batch.fill("0");
  await batch.press("Tab");
  await form.locator("[data-key='training.batch']").getByRole("alert").waitFor();
  await batch.fill("2");
  await batch.press("Tab");
  await form.getByText("1 changed").waitFor();
  assert.equal(await form.locator("[data-key='training.batch'].set").count(), 1);
  await form.getByRole("button", { name: "Check" }).click();
  await form.getByTestId("look").getByText("Nothing speaks against a run.").waitFor();
  await picture(page, "design-form", false);
  await form.getByLabel("keys with the words").fill("");
  await form.getByLabel("folder of the run").fill("runs/watched");
  await form.getByRole("button", { name: "Start" }).click();
  const state = page.getByTestId("run-state");
  await state.filter({ hasText: "running" }).waitFor({ timeout: 120_000 });
  await page.getByRole("region", { name: "Losses" }).locator(".uplot canvas").waitFor();
  await page.waitForFunction(() => Number(document.querySelector("[data-testid=run-steps]")?.textContent.match(/step (\d+)/)?.[1]) > 5);
  await picture(page, "design-running");
  // The studio ends; the design does not.
  await studio.stop("SIGKILL");
  await page.getByRole("alert").getByText("The studio is not reached").waitFor();
  const again = await startStudio(["--port", studio.port], studio.folder);
  try {
    await page.goto(again.url);
    await page.goto(`${new URL(again.url).origin}/#design?run=${encodeURIComponent("runs/watched")}`);
    await page.reload();
    await state.filter({ hasText: "running" }).waitFor();
    await page.getByRole("button", { name: "Stop", exact: true }).click();
    await state.filter({ hasText: "stopped" }).waitFor({ timeout: 60_000 });
    await page.getByRole("button", { name: "Resume" }).click();
    await state.filter({ hasText: "running" }).waitFor({ timeout: 60_000 });
    await page.getByRole("button", { name: "Stop", exact: true }).click();
    await state.filter({ hasText: "stopped" }).waitFor({ timeout: 60_000 });
    await page.getByRole("button", { name: "Report so far" }).click();
    await page.frameLocator("iframe").getByText("At work").first().waitFor();
    assert.ok(!existsSync(join(studio.folder, "runs/watched/report.html")), "nothing is written for it");
  } finally {
    await again.stop();
  }
});

test("finished runs: table, report, film, crops, comparison, sheets, on a phone and in the dark", async (studio) => {
  tiny(studio.folder, 4);
  for (const seed of [1, 2]) {
    execFileSync(PETZVAL, ["design", "tiny.toml", "--seed", String(seed), "--out", `runs/seed-${seed}`], { cwd: studio.folder, stdio: "ignore" });
  }
  const { page, errors } = await open(studio);
  await tab(page, "Runs").click();
  const table = page.getByRole("region", { name: "Runs", exact: true });
  await table.getByRole("button", { name: "seed-1", exact: true }).waitFor();
  await table.getByText("seed = 2").waitFor();
  await table.getByRole("button", { name: "seed-1", exact: true }).click();
  await page.getByTestId("run-state").filter({ hasText: "finished" }).waitFor();
  await page.getByTestId("film").waitFor();
  await page.getByRole("slider", { name: "Step of the film" }).fill("0");
  const crops = page.getByRole("region", { name: "Pictures of the cameras" });
  await crops.locator("img").nth(3).waitFor();
  assert.ok(await crops.locator("img").first().evaluate((img) => img.decode().then(() => img.naturalWidth > 0)));
  await page.getByRole("button", { name: "Report", exact: true }).click();
  await page.frameLocator("iframe[title='Report of runs/seed-1']").getByRole("heading").first().waitFor();
  await picture(page, "run-light");
  await page.getByRole("button", { name: "Report", exact: true }).click();
  for (const seed of [1, 2]) await table.getByRole("checkbox", { name: `mark seed-${seed}` }).check();
  await table.getByRole("button", { name: "Compare the marked runs" }).click();
  await page.frameLocator("iframe[title='Comparison of the marked runs']").getByText("seeds").first().waitFor({ timeout: 60_000 });
  await page.getByRole("region", { name: "Sheets" }).getByRole("link", { name: "runs/seed-1/report.html" }).waitFor();
  // A lens of the run goes into the lens room.
  // By the keyboard: a click right after the page scrolls can land in the frame that was there before.
  await page.getByTitle("Open the lens of nominal").press("Enter");
  await page.getByLabel("radius of surface 1", { exact: true }).waitFor();
  assert.deepEqual(errors, []);
  const phone = await open(studio, { viewport: PHONE, colorScheme: "dark" });
  await tab(phone.page, "Runs").click();
  await phone.page.getByRole("button", { name: "seed-1", exact: true }).click();
  await phone.page.getByTestId("film").waitFor();
  const wider = await phone.page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(wider <= 0, `the runs room is ${wider} px wider than the phone`);
  await picture(phone.page, "phone-runs-dark");
  assert.deepEqual(phone.errors, []);
});

test("the task: loss, gap, slopes by surface, pictures, and the loss of a drag", async (studio) => {
  const { page, errors } = await open(studio);
  await tab(page, "Task").click();
  await page.getByTestId("closed").waitFor({ timeout: 180_000 });
  await page.getByTestId("slopes").filter({ hasText: "of 2 windows" }).waitFor({ timeout: 120_000 });
  const slopes = page.getByRole("region", { name: "Slopes of the loss" });
  assert.ok((await slopes.locator(".bar").count()) >= 10);
  assert.equal(await page.getByRole("img", { name: /^Window \d of the batch$/ }).count(), 2);
  const before = await page.getByTestId("loss").innerText();
  await picture(page, "task-light");
  const handle = page.getByRole("slider", { name: "thickness in front of surface 2", exact: true });
  const box = await handle.boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  for (let i = 1; i <= 8; i++) await page.mouse.move(box.x + box.width / 2 + i, box.y + box.height / 2);
  await page.getByText("Quick: the loss of one window.").waitFor({ timeout: 60_000 });
  await page.mouse.up();
  await page.getByTestId("slopes").filter({ hasText: "of 2 windows" }).waitFor({ timeout: 120_000 });
  assert.notEqual(await page.getByTestId("loss").innerText(), before);
  await page.getByText("that of one differed by").waitFor();
  assert.deepEqual(errors, []);
});

test("an ISP with its sliders, the histogram, and the measured chart", async (studio) => {
  const { page, errors } = await open(studio);
  await tab(page, "Camera").click();
  const chain = page.getByTestId("chain");
  await chain.filter({ hasText: "exact:" }).waitFor({ timeout: 120_000 });
  const pixels = () => page.locator(".canvas canvas").evaluate((c) => c.toDataURL());
  const linear = await pixels();
  await page.getByLabel("Image signal processor").selectOption("neutral");
  await page.waitForFunction((before) => document.querySelector(".canvas canvas").toDataURL() !== before, linear, { timeout: 60_000 });
  await chain.filter({ hasText: "exact:" }).waitFor({ timeout: 120_000 });
  const neutral = await pixels();
  await page.getByRole("region", { name: "ISP" }).getByRole("searchbox").fill("gain.stops");
  await page.getByRole("slider", { name: "gain.stops" }).fill("0.02");
  await page.waitForFunction((before) => document.querySelector(".canvas canvas").toDataURL() !== before, neutral, { timeout: 60_000 });
  assert.match(await page.getByTestId("snr").innerText(), /middle gray: \d+\.\d dB/);
  await page.getByRole("region", { name: "Test chart" }).getByRole("button", { name: "Measure" }).click();
  await page.getByTestId("chart").waitFor({ timeout: 180_000 });
  assert.match(await page.getByTestId("chart").innerText(), /ΔE2000 mean \d/);
  await picture(page, "camera-isp");
  assert.deepEqual(errors, []);
});

test("everything that can be used has a name", async (studio) => {
  const { page } = await open(studio);
  await exact(page);
  const nameless = [];
  for (const room of ["Lens", "Camera", "Task", "Design", "Runs"]) {
    await tab(page, room).click();
    await page.locator("main .panel").first().waitFor();
    nameless.push(...(await unnamed(page)));
  }
  assert.deepEqual(nameless, []);
});

/** Controls without a name. */
const unnamed = (page) =>
  page.evaluate(() => {
    const name = (e) =>
      e.getAttribute("aria-label") || e.getAttribute("title") || e.closest("label")?.textContent.trim() || e.textContent.trim();
    const all = document.querySelectorAll("button, input, select, [role=slider], [role=img]");
    return [...all].filter((e) => !name(e)).map((e) => e.outerHTML.slice(0, 120));
  });

const only = process.env.ONLY;
let failed = 0;
for (const { name, run } of tests.filter((t) => !only || t.name.includes(only))) {
  const studio = await startStudio();
  const began = performance.now();
  try {
    await run(studio);
    console.log(`ok      ${((performance.now() - began) / 1000).toFixed(1)} s  ${name}`);
  } catch (error) {
    failed += 1;
    console.log(`FAILED  ${name}\n${error.stack}`);
    const contexts = browser.contexts().flatMap((context) => context.pages());
    for (const [i, page] of contexts.entries()) {
      await page.screenshot({ path: join(pictures, `failed-${failed}-${i}.png`) }).catch(() => {});
    }
  } finally {
    for (const context of browser.contexts()) await context.close();
    await studio.stop();
    forget(studio.folder);
  }
}
await browser.close();
console.log(`${failed === 0 ? "passed" : `${failed} FAILED`}; screenshots in ${pictures}`);
process.exit(failed === 0 ? 0 : 1);
