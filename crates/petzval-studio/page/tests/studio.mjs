// The studio in a browser: every test opens it anew. `node tests/studio.mjs [FOLDER]` keeps the screenshots in a folder.
//
// Each step waits for what the page shows, never for a time.

import assert from "node:assert/strict";
import { mkdirSync, mkdtempSync, readFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { forget, startBrowser, startStudio } from "./browser.mjs";

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
  await page.getByRole("button", { name: "Camera", exact: true }).click();
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
  await phone.page.getByRole("button", { name: "Camera", exact: true }).click();
  await phone.page.getByTestId("chain").filter({ hasText: "quick:" }).or(phone.page.getByTestId("chain").filter({ hasText: "exact:" })).waitFor();
  assert.ok((await wider()) <= 0, "the camera room is wider than the phone");
  await picture(phone.page, "phone-camera");
  assert.deepEqual([...dark.errors, ...phone.errors], []);
});

test("everything that can be used has a name", async (studio) => {
  const { page } = await open(studio);
  await exact(page);
  const nameless = await page.evaluate(() => {
    const name = (e) =>
      e.getAttribute("aria-label") || e.getAttribute("title") || e.closest("label")?.textContent.trim() || e.textContent.trim();
    const all = document.querySelectorAll("button, input, select, [role=slider], [role=img]");
    return [...all].filter((e) => !name(e)).map((e) => e.outerHTML.slice(0, 120));
  });
  assert.deepEqual(nameless, []);
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
