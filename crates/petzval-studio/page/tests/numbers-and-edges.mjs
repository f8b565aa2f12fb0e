// What sets the numbers of a lens: bounds, pickups, solves, weights. And the camera room's object distance, edges, and lenses without symmetry.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";

/** Adds the tests; `kit` holds what those of the other file use. */
export function numbersAndEdges(test, { open, tab, exact, toml, picture, PHONE }) {
  const at = (page, count) => page.waitForFunction((count) => JSON.parse(sessionStorage.getItem("petzval-studio")).at === count, count);
  const cell = (page, what, surface) => page.getByRole("textbox", { name: `${what} of surface ${surface}`, exact: true });
  const mark = (page, parameter, surface, words) => page.getByRole("button", { name: new RegExp(`^${parameter} of surface ${surface}: ${words}`) });
  const dialog = (page) => page.getByRole("dialog", { name: /^What sets the/ });
  const chain = (page, what) => page.getByTestId("chain").filter({ hasText: what }).waitFor();
  const pixels = (page) => page.locator(".canvas canvas").evaluate((canvas) => canvas.toDataURL());
  const differs = (page, before) => page.waitForFunction((before) => document.querySelector(".canvas canvas").toDataURL() !== before, before);
  const drop = (page, file, text) =>
    page.evaluate(
      ([file, text]) => {
        const transfer = new DataTransfer();
        transfer.items.add(new File([text], file));
        window.dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, cancelable: true, bubbles: true }));
      },
      [file, text],
    );

  test("bounds, pickups and solves of a number, by the keyboard, through undo, saving and opening", async (studio) => {
    const { page, errors } = await open(studio);
    const first = await toml(page);
    // Bounds: the dialog opens at the number's own.
    await cell(page, "radius", 1).focus();
    await page.keyboard.press("Alt+Enter");
    await dialog(page).waitFor();
    assert.equal(await dialog(page).getByLabel("least value").inputValue(), "9.85");
    await dialog(page).getByLabel("least value").fill("11");
    await dialog(page).getByLabel("greatest value").fill("12,5");
    await picture(page, "number-dialog", false);
    await page.keyboard.press("Enter");
    await at(page, 1);
    await dialog(page).waitFor({ state: "hidden" });
    assert.match(await toml(page), /parameter = "radius_mm"\nmin = 11\.0\nmax = 12\.5\n/);
    await mark(page, "radius_mm", 1, "varies from 11 to 12.5").waitFor();
    // Bounds that leave the lens out are widened, and the page says so.
    await cell(page, "radius", 2).focus();
    await page.keyboard.press("Alt+Enter");
    await dialog(page).getByLabel("least value").fill("12");
    await dialog(page).getByLabel("greatest value").fill("14");
    await page.keyboard.press("Enter");
    await at(page, 2);
    await page.getByText("the bounds are wider than those given, 11.45 to 14").waitFor();
    // A pickup: arrows choose it, what is no number is refused within the dialog.
    await mark(page, "radius_mm", 4, "held").click();
    assert.equal(await page.evaluate(() => document.activeElement.value), "held");
    await page.keyboard.press("ArrowDown");
    await page.keyboard.press("ArrowDown");
    await dialog(page).getByLabel("surface that it follows").selectOption("3");
    await dialog(page).getByLabel("factor").fill("one");
    await page.keyboard.press("Enter");
    await dialog(page).getByRole("alert").getByText("“one” is no number").waitFor();
    await dialog(page).getByLabel("factor").fill("-1");
    await picture(page, "number-dialog-pickup", false);
    await page.keyboard.press("Enter");
    await at(page, 3);
    await mark(page, "radius_mm", 4, "follows surface 3, times -1, as curvatures").waitFor();
    assert.ok(!(await cell(page, "radius", 4).isEditable()), "a number that follows is not typed");
    await cell(page, "radius", 3).fill("-38");
    await cell(page, "radius", 3).press("Tab");
    await at(page, 4);
    await page.waitForFunction(() => document.querySelector("[data-cell='4-radius']").value === "38");
    // A solve: the length stays when another thickness changes.
    await mark(page, "thickness_mm", 4, "varies").click();
    await dialog(page).getByRole("radio", { name: /holds the length/ }).check();
    await dialog(page).getByRole("button", { name: "Apply" }).click();
    await at(page, 5);
    await mark(page, "thickness_mm", 4, "holds the length of 22.2 mm").waitFor();
    await cell(page, "thickness", 2).fill("8.01");
    await cell(page, "thickness", 2).press("Tab");
    await at(page, 6);
    await page.waitForFunction(() => document.querySelector("[data-cell='4-thickness']").value === "3.63");
    // What the server refuses is said within the dialog, and nothing changes.
    await mark(page, "thickness_mm", 4, "holds the length").click();
    await dialog(page).getByLabel("length", { exact: true }).fill("1");
    await dialog(page).getByRole("button", { name: "Apply" }).click();
    await dialog(page).getByRole("alert").waitFor();
    await page.keyboard.press("Escape");
    await dialog(page).waitFor({ state: "hidden" });
    // A number of surface 7 that the file solves for.
    await mark(page, "radius_mm", 7, "holds the focal length of 25.04004 mm").waitFor();
    const last = await toml(page);
    // Saved, opened again: the very same.
    await page.keyboard.press("Control+s");
    const save = page.getByRole("dialog", { name: "Save the lens as" });
    await save.getByLabel("Name").fill("tied");
    await save.getByRole("button", { name: "Write into the folder" }).click();
    await save.waitFor({ state: "hidden" });
    const written = readFileSync(join(studio.folder, "tied.toml"), "utf8");
    assert.equal(written, last);
    for (let step = 5; step >= 0; step--) {
      await page.getByRole("button", { name: "Undo" }).click();
      await at(page, step);
    }
    assert.equal(await toml(page), first, "undo gives the first lens to the bit");
    for (let step = 1; step <= 6; step++) {
      await page.getByRole("button", { name: "Redo" }).click();
      await at(page, step);
    }
    assert.equal(await toml(page), last);
    await page.getByRole("button", { name: "Undo" }).click();
    await at(page, 5);
    await drop(page, "tied.toml", written);
    await page.waitForFunction((last) => JSON.parse(sessionStorage.getItem("petzval-studio")).steps[0].toml === last, last);
    await mark(page, "radius_mm", 4, "follows surface 3").waitFor();
    assert.deepEqual(errors, []);
  });

  test("the dialog of a number in the dark, as wide as a phone, and named throughout", async (studio) => {
    const { page, errors } = await open(studio, { viewport: PHONE, colorScheme: "dark" });
    await exact(page);
    await mark(page, "radius_mm", 4, "held").click();
    await dialog(page).getByRole("radio", { name: "follows another surface" }).check();
    const box = await dialog(page).boundingBox();
    assert.ok(box.x >= 0 && box.x + box.width <= PHONE.width, JSON.stringify(box));
    const nameless = await dialog(page).evaluate((dialog) =>
      [...dialog.querySelectorAll("button, input, select")]
        .filter((e) => !(e.getAttribute("aria-label") || e.closest("label")?.textContent.trim() || e.textContent.trim()))
        .map((e) => e.outerHTML.slice(0, 120)),
    );
    assert.deepEqual(nameless, []);
    await picture(page, "phone-number-dark", false);
    await dialog(page).getByRole("button", { name: "Cancel" }).click();
    await dialog(page).waitFor({ state: "hidden" });
    assert.deepEqual(errors, []);
  });

  test("weights of the fields go into the file, and into the optimisation", async (studio) => {
    const { page, errors, heard } = await open(studio);
    const weights = page.getByLabel("Weights of the fields");
    assert.equal(await weights.inputValue(), "1, 1, 1, 1");
    await weights.fill("0 0 0 0");
    await weights.press("Tab");
    await page.getByRole("alert").getByText("no field would count").waitFor();
    assert.equal(await weights.inputValue(), "1, 1, 1, 1");
    await weights.fill("0, 0, 1, 8");
    await weights.press("Tab");
    await at(page, 1);
    assert.match(await toml(page), /weight = \[0\.0, 0\.0, 1\.0, 8\.0\]/);
    await page.getByText("fields by their weights").waitFor();
    const edge = () => page.getByTestId("rms").last().innerText().then(Number.parseFloat);
    await exact(page);
    const before = await edge();
    await page.getByLabel("Iterations").fill("20");
    await page.getByRole("button", { name: "Optimise" }).click();
    await at(page, 2);
    await exact(page);
    assert.ok((await edge()) < 0.8 * before, `${await edge()} after ${before}`);
    assert.match(await toml(page), /weight = \[0\.0, 0\.0, 1\.0, 8\.0\]/);
    assert.ok(heard.calls.some(({ job, request }) => job === "lens-optimize" && request.start.new.lens.toml.includes("weight = ")));
    await weights.fill("");
    await weights.press("Tab");
    await at(page, 3);
    assert.ok(!(await toml(page)).includes("weight"));
    assert.deepEqual(errors, []);
  });

  test("a photograph through a decentred lens, and through a biconic one", async (studio) => {
    const { page, errors } = await open(studio);
    await tab(page, "Camera").click();
    await chain(page, "exact:");
    const centred = await pixels(page);
    const text = await toml(page);
    const gap = "thickness_mm = 8.11\n";
    assert.ok(text.includes(gap));
    const decentred = text.replace(gap, `placement = { decenter_mm = [0.07, 0.07], tilt_deg = [0.0, 0.0, 0.0], axis = "returns" }\n${gap}`);
    await drop(page, "decentred.toml", decentred.replace(/^name = .*$/m, 'name = "decentred"'));
    await page.waitForFunction(() => document.querySelector("input.name")?.value === "decentred");
    await chain(page, "exact:");
    await differs(page, centred);
    assert.equal(await page.locator(".picture [role=alert]").count(), 0);
    await picture(page, "camera-decentred", false);
    const middle = await pixels(page);
    await page.getByRole("slider", { name: "Place on the sensor" }).focus();
    await page.keyboard.press("ArrowRight");
    await page.keyboard.press("ArrowRight");
    await differs(page, middle);
    await chain(page, "exact:");
    const astigmatic = text.replace(gap, `biconic = { radius_x_mm = 11.2, conic_x = 0.0 }\n${gap}`);
    await drop(page, "biconic.toml", astigmatic.replace(/^name = .*$/m, 'name = "biconic"'));
    await page.waitForFunction(() => document.querySelector("input.name")?.value === "biconic");
    await chain(page, "exact:");
    await picture(page, "camera-biconic", false);
    assert.deepEqual(errors, []);
  });

  test("the object distance of the camera room leaves the lens as it is", async (studio) => {
    const { page, errors } = await open(studio);
    const before = await toml(page);
    await tab(page, "Camera").click();
    await chain(page, "exact:");
    const far = await pixels(page);
    const distance = page.getByRole("slider", { name: "Object distance" });
    assert.equal(await distance.getAttribute("aria-valuetext"), "infinity");
    await distance.fill("45");
    assert.match(await distance.getAttribute("aria-valuetext"), / m$/);
    await differs(page, far);
    await chain(page, "exact:");
    await picture(page, "camera-near", false);
    const near = await pixels(page);
    await distance.focus();
    await page.keyboard.press("ArrowLeft");
    await differs(page, near);
    await page.getByRole("button", { name: "Distance of the lens" }).click();
    await chain(page, "exact:");
    await page.waitForFunction((far) => document.querySelector(".canvas canvas").toDataURL() === far, far);
    assert.equal(await toml(page), before);
    assert.deepEqual(errors, []);
  });

  test("an edge in a region that one draws, by the pointer and by keys", async (studio) => {
    const { page, errors } = await open(studio);
    await tab(page, "Camera").click();
    await page.getByLabel("Scene").selectOption("scene:slanted-edge");
    await chain(page, "exact:");
    const panel = page.getByRole("region", { name: "Edge in the picture" });
    await panel.getByRole("checkbox", { name: "measure" }).check();
    const edge = panel.getByTestId("edge");
    await edge.filter({ hasText: /MTF50 0\.\d{3} ± 0\.\d{3} cycles\/pixel\s+in luminance; edge at 5\.\d°/ }).waitFor();
    await picture(page, "camera-edge");
    // A region that is drawn holds no edge, and says so; the keys move it back onto the edge.
    const region = page.getByRole("slider", { name: "Region of the edge" });
    await region.scrollIntoViewIfNeeded();
    const box = await region.boundingBox();
    const to = async (x, y) => page.mouse.move(box.x + x * box.width, box.y + y * box.height);
    await to(0.05, 0.4);
    await page.mouse.down();
    await to(0.3, 0.5);
    await to(0.3, 0.6);
    await page.mouse.up();
    await panel.getByRole("alert").getByText("one straight edge").waitFor();
    await region.focus();
    for (let i = 0; i < 40; i++) await page.keyboard.press("ArrowRight");
    await panel.getByRole("alert").waitFor({ state: "detached" });
    await edge.filter({ hasNotText: "picture before" }).waitFor();
    const width = async () => Number((await region.getAttribute("aria-valuetext")).match(/columns (\d+) to (\d+)/).slice(1).reduce((a, b) => b - a));
    const wide = await width();
    await page.keyboard.press("Shift+ArrowLeft");
    assert.equal(await width(), wide - 4);
    assert.deepEqual(errors, []);
  });
}
