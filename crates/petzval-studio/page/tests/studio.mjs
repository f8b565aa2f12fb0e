// The studio in a browser: every test opens it anew. `node tests/studio.mjs [FOLDER]` keeps the screenshots in a folder.
//
// Each step waits for what the page shows, never for a time.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { PETZVAL, forget, servePage, slowness, startBrowser, startStudio } from "./browser.mjs";
import { numbersAndEdges } from "./numbers-and-edges.mjs";
import { saidAndKept } from "./said-and-kept.mjs";

const pictures = process.argv[2] ?? mkdtempSync(join(tmpdir(), "petzval-studio-pictures-"));
mkdirSync(pictures, { recursive: true });

const WIDE = { width: 1440, height: 1000 };
const PHONE = { width: 390, height: 844 };

const browser = await startBrowser();
const tests = [];
const test = (name, run) => tests.push({ name, run });

/** Milliseconds in which what takes some seconds on a quiet machine must have come. */
const patience = () => 120_000 * slowness();

/** What a page says over its sockets: its calls in their order, and how many of them were at work at once. */
function listenTo(page) {
  const heard = { calls: [], most: new Map(), atWork: new Map(), onProcess: () => {} };
  const kind = ({ job, request, live }) => `${job}${live ? " live" : request.quick === false ? " exact" : ""}`;
  page.on("websocket", (socket) => {
    socket.on("framesent", ({ payload }) => {
      const call = JSON.parse(payload);
      if (call.cancel !== undefined) return;
      heard.calls.push(call);
      heard.atWork.set(call.id, kind(call));
      const count = [...heard.atWork.values()].filter((other) => other === kind(call)).length;
      heard.most.set(kind(call), Math.max(count, heard.most.get(kind(call)) ?? 0));
    });
    socket.on("framereceived", ({ payload }) => {
      // Before bytes stands the length of their message.
      const text = typeof payload === "string" ? payload : payload.subarray(4, 4 + payload.readUInt32LE(0)).toString();
      const { id, event, response } = JSON.parse(text);
      if (event) return;
      heard.atWork.delete(id);
      if (response?.process !== undefined) heard.onProcess(response.process);
    });
  });
  return heard;
}

/** A page of a studio, whose errors fail the test. */
async function open(studio, { viewport = WIDE, colorScheme = "light", context } = {}) {
  const owner = context ?? (await browser.newContext({ viewport, colorScheme, acceptDownloads: true }));
  if (!context) await servePage(owner);
  const page = await owner.newPage();
  page.setDefaultTimeout(patience());
  const heard = listenTo(page);
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  await page.goto(studio.url);
  await page.getByLabel("radius of surface 1", { exact: true }).waitFor();
  return { page, owner, errors, heard };
}

const radius = (page, surface = 1) => page.getByLabel(`radius of surface ${surface}`, { exact: true });
const exact = (page) => page.getByTestId("accuracy").filter({ hasText: "exact" }).first().waitFor();
const picture = (page, name, fullPage = true) => page.screenshot({ path: join(pictures, `${name}.png`), fullPage });
/** The lens as the tab keeps it. */
const steps = (page) => page.evaluate(() => JSON.parse(sessionStorage.getItem("petzval-studio")));
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
  assert.ok(paint < 1000 * slowness(), `first paint after ${paint} ms`);
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

test("an undo right after an edit takes the edit back, and fields keep their own undo", async (studio) => {
  const { page, errors } = await open(studio);
  const before = await toml(page);
  const kept = () => page.evaluate(() => JSON.parse(sessionStorage.getItem("petzval-studio")));
  // Both keys come before the server has answered the edit.
  await radius(page).focus();
  await page.keyboard.type("25.5");
  await page.evaluate(() => {
    const key = (key, more) => document.activeElement.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true, ...more }));
    key("Enter", {});
    key("z", { ctrlKey: true });
  });
  await page.waitForFunction(() => {
    const { steps, at } = JSON.parse(sessionStorage.getItem("petzval-studio"));
    return steps.length === 2 && at === 0;
  });
  assert.equal(await toml(page), before);
  await page.getByRole("button", { name: "Redo" }).click();
  await page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 1);
  assert.match(await toml(page), /radius_mm = 25\.5\n/);
  // In a field that is being typed into, the keys are the field's.
  const name = page.getByLabel("Name of the lens");
  const called = await name.inputValue();
  await name.focus();
  await page.keyboard.press("End");
  await page.keyboard.type("x");
  await page.keyboard.press("Control+z");
  await page.waitForFunction((called) => document.querySelector("input.name").value === called, called);
  assert.equal((await kept()).at, 1, "the lens stays");
  // In rooms that show other things than the lens, nothing undoes it unseen.
  for (const room of ["Design", "Runs"]) {
    await tab(page, room).click();
    await page.locator("main .panel").first().waitFor();
    await page.keyboard.press("Control+z");
    await tab(page, "Lens").click();
    await radius(page).waitFor();
    assert.equal((await kept()).at, 1, room);
  }
  await page.locator("h1").click();
  await page.keyboard.press("Control+z");
  await page.waitForFunction(() => JSON.parse(sessionStorage.getItem("petzval-studio")).at === 0);
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

/** Drags the curvature of the first surface, in some steps; the button stays down. */
async function dragCurvature(page, steps, pause = 30) {
  const handle = page.getByRole("slider", { name: "curvature of surface 1", exact: true });
  const place = async () => {
    const { x, y, width, height } = await handle.boundingBox();
    return [x + width / 2, y + height / 2];
  };
  // In a window of another size things move for a moment.
  let [[x, y], before] = [await place(), []];
  while (x !== before[0] || y !== before[1]) {
    before = [x, y];
    await page.waitForTimeout(200);
    [x, y] = await place();
  }
  await page.mouse.move(x, y);
  await page.mouse.down();
  for (let i = 1; i <= steps; i++) {
    await page.mouse.move(x + 4 * Math.sin(i / 4), y);
    await page.waitForTimeout(pause);
  }
}

test("a drag looks at what the window shows, draws no plot anew, and the cross-section does not outrun the picture", async (studio) => {
  const { page, errors, heard } = await open(studio);
  await exact(page);
  const plots = () => page.locator(".plot canvas").evaluateAll((all) => all.map((canvas) => (canvas.dataset.kept ??= "new")));
  assert.equal(await page.locator(".plot canvas").evaluateAll((all) => all.map((canvas) => (canvas.dataset.kept = "old")).length), 4);
  const since = async (work) => {
    const from = heard.calls.length;
    await work();
    return heard.calls.slice(from).filter(({ live, request }) => live && request.edits.length > 0);
  };
  const whole = await since(() => dragCurvature(page, 24));
  assert.ok(whole.some(({ live, request }) => live === "lens-slow" && request.parts.includes("mtf")));
  assert.ok(whole.some(({ live, request }) => live === "lens" && request.parts.join() === "layout,spots,fans"));
  assert.deepEqual(await plots(), ["old", "old", "old", "old"]);
  await page.keyboard.press("Escape");
  await page.mouse.up();
  await exact(page);
  // A low and narrow window shows the cross-section alone.
  await page.setViewportSize({ width: 800, height: 420 });
  const layout = await since(() => dragCurvature(page, 24));
  const parts = layout.map(({ live, request }) => `${live}: ${request.parts.join()}`);
  assert.deepEqual([...new Set(parts)], ["lens: layout"]);
  await page.keyboard.press("Escape");
  await page.mouse.up();
  // What was not looked at follows.
  await exact(page);
  await page.setViewportSize(WIDE);
  await tab(page, "Camera").click();
  await page.getByTestId("chain").filter({ hasText: "exact:" }).waitFor();
  const both = await since(() => dragCurvature(page, 60));
  const count = (channel) => both.filter(({ live }) => live === channel).length;
  assert.ok(count("camera") >= 2 && count("lens") <= count("camera") + 2, `${count("lens")} cross-sections and ${count("camera")} pictures`);
  await page.mouse.up();
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
  await page.getByRole("button", { name: "Optimise" }).waitFor();
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
  await dialog.waitFor({ state: "hidden" });
  assert.equal(readFileSync(join(studio.folder, "kept.toml"), "utf8"), await toml(page));
  // A second time the file is there, and is overwritten on demand alone.
  await page.keyboard.press("Control+s");
  await dialog.getByRole("button", { name: "Write into the folder" }).click();
  await dialog.getByRole("alert").waitFor();
  await dialog.getByRole("button", { name: "Overwrite" }).click();
  await page.getByText("written: kept.toml").waitFor();
  await dialog.waitFor({ state: "hidden" });
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
  await chain.filter({ hasText: "exact:" }).waitFor();
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
  await chain.filter({ hasText: "exact:" }).waitFor();
  const blurred = await pixels();
  await page.getByRole("radio", { name: "Split" }).check();
  await page.waitForFunction((after) => document.querySelector(".canvas canvas").toDataURL() !== after, blurred);
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
  await page.locator("footer").filter({ hasText: /[1-9]\d* % of the corner/ }).waitFor();
  await chain.filter({ hasText: "exact:" }).waitFor();
  await picture(page, "camera-astronaut");
  assert.deepEqual(errors, []);
});

test("the picture before an edit follows a slider without a queue", async (studio) => {
  const { page, errors, heard } = await open(studio, { colorScheme: "dark" });
  await tab(page, "Camera").click();
  await page.getByTestId("chain").filter({ hasText: "exact:" }).waitFor();
  await page.getByRole("radio", { name: "Split" }).check();
  const moved = heard.calls.length;
  await page.getByLabel("Exposure, stops").evaluate(async (slider) => {
    for (let i = 1; i <= 24; i++) {
      slider.value = String(-i / 8);
      slider.dispatchEvent(new Event("input", { bubbles: true }));
      await new Promise(requestAnimationFrame);
    }
  });
  // The last exact pictures are of the last exposure: one after, and one before the edit.
  const last = (calls) => calls.filter(({ job, request }) => job === "camera-view" && !request.quick && request.exposure_ev === -3).length;
  while (last(heard.calls.slice(moved)) < 2 || heard.atWork.size > 0) await page.waitForTimeout(100);
  assert.ok(heard.most.get("camera-view exact") <= 2, `${heard.most.get("camera-view exact")} exact pictures at once`);
  await picture(page, "camera-dark");
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

test("changes of a form build on one another, and a refused value keeps its reason", async (studio) => {
  tiny(studio.folder, 40);
  const { page, errors } = await open(studio);
  await page.goto(`${new URL(studio.url).origin}/#design?experiment=tiny.toml`);
  await page.reload();
  const form = page.getByRole("region", { name: "Experiment", exact: true });
  await form.getByText("as in its file").waitFor();
  await form.getByLabel("keys with the words").fill("training.");
  const field = (key) => form.locator(`[data-key='${key}']`);
  // Both are changed before the first is answered.
  await page.evaluate(() => {
    for (const [key, value] of [["training.batch", "3"], ["training.crop", "96"]]) {
      const input = document.querySelector(`[data-key='${key}'] input`);
      input.value = value;
      input.dispatchEvent(new Event("change", { bubbles: true }));
    }
  });
  await form.getByText("2 changed").waitFor();
  assert.equal(await field("training.batch").locator("input").inputValue(), "3");
  assert.equal(await field("training.crop").locator("input").inputValue(), "96");
  // A value that is refused stays with its reason while others are changed, and no run begins with it on the screen.
  const start = form.getByRole("button", { name: "Start" });
  await field("training.batch").locator("input").fill("0");
  await field("training.batch").locator("input").press("Tab");
  await field("training.batch").getByRole("alert").waitFor();
  await field("training.steps").locator("input").fill("44");
  await field("training.steps").locator("input").press("Tab");
  await form.getByText("3 changed").waitFor();
  assert.equal(await field("training.batch").locator("input").inputValue(), "0");
  assert.equal(await field("training.batch").getByRole("alert").count(), 1);
  assert.ok(await start.isDisabled());
  await picture(page, "design-refused", false);
  await field("training.batch").getByRole("button", { name: "take back" }).click();
  await form.getByText("2 changed").waitFor();
  assert.equal(await field("training.batch").getByRole("alert").count(), 0);
  assert.equal(await field("training.batch").locator("input").inputValue(), "1");
  assert.ok(await start.isEnabled());
  // An undo by the keys is that of the field alone.
  await field("training.steps").locator("input").press("Control+z");
  assert.equal(await page.evaluate(() => JSON.parse(sessionStorage.getItem("petzval-studio")).steps.length), 1);
  assert.deepEqual(errors, []);
});

test("a run that cannot begin says why, and a reader who went elsewhere stays there", async (studio) => {
  tiny(studio.folder, 4000);
  const { page, errors, heard } = await open(studio);
  await page.goto(`${new URL(studio.url).origin}/#design?experiment=tiny.toml`);
  await page.reload();
  const form = page.getByRole("region", { name: "Experiment", exact: true });
  const start = form.getByRole("button", { name: "Start" });
  const begin = async (folder) => {
    await form.getByLabel("folder of the run").fill(folder);
    await start.click();
  };
  await form.getByText("as in its file").waitFor();
  // A process that is killed says nothing itself: its log ends with how it ended.
  heard.onProcess = (process_) => process.kill(process_, "SIGKILL");
  await begin("runs/killed");
  await form.getByRole("alert").getByText("the process was killed").waitFor();
  assert.ok(await start.isEnabled());
  // The reader looks at the lens when the run has begun.
  let begun;
  heard.onProcess = (process_) => (begun = process_);
  await begin("runs/alone");
  while (begun === undefined) await page.waitForTimeout(20);
  await tab(page, "Lens").click();
  const events = join(studio.folder, "runs/alone/events.jsonl");
  while (!existsSync(events)) await page.waitForTimeout(100);
  await page.waitForTimeout(1500);
  await radius(page).waitFor();
  assert.match(page.url(), /#lens/);
  // The folder holds that run now, and another does not begin in it.
  await tab(page, "Design").click();
  await form.getByText("as in its file").waitFor();
  await begin("runs/alone");
  await form.getByRole("alert").getByText("this folder holds a run").waitFor();
  assert.ok(!page.url().includes("run="));
  process.kill(begun, "SIGKILL");
  assert.deepEqual(errors, []);
});

test("a sweep: its cameras as points, the best of them, and the run behind one", async (studio) => {
  tiny(studio.folder, 4);
  const sweep = 'experiment = "tiny.toml"\nseeds = [1, 2]\n[grid]\ntraining.learning_rate = [1e-3, 3e-3]\n';
  writeFileSync(join(studio.folder, "rates.toml"), sweep);
  execFileSync(PETZVAL, ["sweep", "rates.toml", "--submit", "here"], { cwd: studio.folder, stdio: "ignore" });
  const { page, errors, heard } = await open(studio);
  await tab(page, "Design").click();
  await page.getByPlaceholder("folder of a sweep").fill("sweeps/rates");
  await page.getByPlaceholder("folder of a sweep").press("Enter");
  const panel = page.getByRole("region", { name: "Sweep" });
  const points = panel.locator("circle");
  await points.first().waitFor();
  // Two rates, two seeds, three cameras each.
  assert.equal(await points.count(), 12);
  await panel.getByLabel("to the right").selectOption("ssim");
  await panel.getByText("Pareto front").waitFor();
  await points.first().focus();
  await page.keyboard.press("Enter");
  await panel.getByTestId("point").waitFor();
  await picture(page, "sweep", false);
  await panel.getByRole("button", { name: "Open this run" }).click();
  await page.getByTestId("run-state").filter({ hasText: "finished" }).waitFor();
  assert.equal(heard.most.get("sweep-gather"), 1);
  const crops = page.getByRole("region", { name: "Pictures of the cameras" }).locator("img");
  await crops.nth(3).waitFor();
  assert.ok(await crops.first().evaluate((img) => img.decode().then(() => img.naturalWidth > 0)));
  // The runs of a sweep stand in the table of runs.
  await tab(page, "Runs").click();
  await page.getByLabel("folder", { exact: true }).fill("sweeps");
  await page.getByLabel("folder", { exact: true }).press("Enter");
  await page.getByRole("region", { name: "Runs", exact: true }).getByRole("button", { name: /^rates: / }).nth(3).waitFor();
  await picture(page, "sweep-runs", false);
  // Another folder ends the looks at the one before.
  for (const folder of ["a", "b", "c", "sweeps"]) {
    await page.getByLabel("folder", { exact: true }).fill(folder);
    await page.getByLabel("folder", { exact: true }).press("Enter");
  }
  await page.getByRole("region", { name: "Runs", exact: true }).getByRole("button", { name: /^rates: / }).first().waitFor();
  const looked = heard.calls.length;
  await page.waitForTimeout(7000);
  const looks = heard.calls.slice(looked).filter(({ job }) => job === "runs");
  assert.ok(looks.length <= 2 && looks.every(({ request }) => request.folder === "sweeps"), JSON.stringify(looks));
  assert.deepEqual(errors, []);
  const phone = await open(studio, { viewport: PHONE, colorScheme: "dark" });
  await phone.page.goto(`${new URL(studio.url).origin}/#design?sweep=${encodeURIComponent("sweeps/rates")}`);
  await phone.page.reload();
  await phone.page.getByRole("region", { name: "Sweep" }).locator("circle").first().waitFor();
  const wider = await phone.page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(wider <= 0, `the design room is ${wider} px wider than the phone`);
  await picture(phone.page, "phone-sweep-dark");
  assert.deepEqual(phone.errors, []);
});

test("an experiment as a form, started, watched, stopped, and found again by the next studio", async (studio) => {
  tiny(studio.folder, 4000);
  const { page, errors, heard } = await open(studio);
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
  await state.filter({ hasText: "running" }).waitFor();
  await page.getByRole("region", { name: "Losses" }).locator(".uplot canvas").waitFor();
  await page.waitForFunction(() => Number(document.querySelector("[data-testid=run-steps]")?.textContent.match(/step (\d+)/)?.[1]) > 5);
  // The film looks at a lens once.
  const films = heard.calls.filter(({ job, request }) => job === "lens-view" && typeof request.lens === "string").map(({ request }) => request.lens);
  assert.ok(films.length > 0 && new Set(films).size === films.length, films.join(" "));
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
    await state.filter({ hasText: "stopped" }).waitFor();
    assert.equal(await page.getByText(/ends after its step/).count(), 0, "what was said of the stop is over");
    await page.getByRole("button", { name: "Resume" }).click();
    await page.getByText(/process \d+ goes on with the run/).waitFor();
    await state.filter({ hasText: "running" }).waitFor();
    await page.getByRole("button", { name: "Stop", exact: true }).click();
    await state.filter({ hasText: "stopped" }).waitFor();
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
  await page.frameLocator("iframe[title='Comparison of the marked runs']").getByText("seeds").first().waitFor();
  await page.getByRole("region", { name: "Sheets" }).getByRole("link", { name: "runs/seed-1/report.html" }).waitFor();
  // The task of a camera is that of its row, not of another one.
  await page.getByTitle("Look at the task with the network of nominal").press("Enter");
  await page.getByRole("region", { name: "Task", exact: true }).getByText(", camera nominal, network").waitFor();
  await page.getByRole("button", { name: "Open the lens of the camera nominal" }).waitFor();
  await tab(page, "Runs").click();
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
  await page.getByTestId("closed").waitFor();
  await page.getByTestId("slopes").filter({ hasText: "of 2 windows" }).waitFor();
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
  await page.getByText("Quick: the loss of one window.").waitFor();
  await page.mouse.up();
  await page.getByTestId("slopes").filter({ hasText: "of 2 windows" }).waitFor();
  assert.notEqual(await page.getByTestId("loss").innerText(), before);
  await page.getByText("that of one differed by").waitFor();
  assert.deepEqual(errors, []);
});

test("an ISP with its sliders, the histogram, and the measured chart", async (studio) => {
  const { page, errors } = await open(studio);
  await tab(page, "Camera").click();
  const chain = page.getByTestId("chain");
  await chain.filter({ hasText: "exact:" }).waitFor();
  const pixels = () => page.locator(".canvas canvas").evaluate((c) => c.toDataURL());
  const linear = await pixels();
  await page.getByLabel("Image signal processor").selectOption("neutral");
  await page.waitForFunction((before) => document.querySelector(".canvas canvas").toDataURL() !== before, linear);
  await chain.filter({ hasText: "exact:" }).waitFor();
  const neutral = await pixels();
  await page.getByRole("region", { name: "ISP" }).getByRole("searchbox").fill("gain.stops");
  await page.getByRole("slider", { name: "gain.stops" }).fill("0.02");
  await page.waitForFunction((before) => document.querySelector(".canvas canvas").toDataURL() !== before, neutral);
  assert.match(await page.getByTestId("snr").innerText(), /middle gray: \d+\.\d dB/);
  await page.getByRole("region", { name: "Test chart" }).getByRole("button", { name: "Measure" }).click();
  await page.getByTestId("chart").waitFor();
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

saidAndKept(test, { open, tab, exact, toml, steps });
numbersAndEdges(test, { open, tab, exact, toml, picture, PHONE });

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
