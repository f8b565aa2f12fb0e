// What the page says beside its figures, and what it keeps: warnings, refusals, unsaved changes, the settings of rooms, jobs at work.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { PETZVAL, startStudio } from "./browser.mjs";

/** Adds the tests; `kit` holds what those of the other file use. */
export function saidAndKept(test, { open, tab, exact, toml, steps }) {
  const at = (page, count) => page.waitForFunction((count) => JSON.parse(sessionStorage.getItem("petzval-studio")).at === count, count);
  const radius = (page, surface = 1) => page.getByRole("textbox", { name: `radius of surface ${surface}`, exact: true });
  const name = (page) => page.getByLabel("Name of the lens").inputValue();

  /** Drops a file onto the page. */
  const drop = (page, file, text) =>
    page.evaluate(
      ([file, text]) => {
        const transfer = new DataTransfer();
        transfer.items.add(new File([text], file));
        window.dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, cancelable: true, bubbles: true }));
      },
      [file, text],
    );

  /** Moves the image plane 1 mm further. */
  async function defocus(page) {
    const last = await page.getByRole("textbox", { name: /^thickness of surface/ }).count();
    const cell = page.getByRole("textbox", { name: `thickness of surface ${last}`, exact: true });
    await cell.focus();
    await cell.fill(String(Number(await cell.inputValue()) + 1));
    await cell.press("Tab");
    await at(page, 1);
  }

  test("a picture that is too sharp says so, at each place", async (studio) => {
    const { page, errors } = await open(studio);
    await defocus(page);
    await tab(page, "Camera").click();
    const chain = page.getByTestId("chain");
    await chain.filter({ hasText: "exact:" }).waitFor();
    const said = page.getByTestId("camera-warning").filter({ hasText: "cuts off" });
    await said.waitFor();
    // The camera is kept for further places; what is to be said of it is as well.
    await page.getByRole("slider", { name: "Place on the sensor" }).focus();
    await page.keyboard.press("ArrowRight");
    await chain.filter({ hasText: "quick:" }).waitFor();
    await chain.filter({ hasText: "exact:" }).waitFor();
    assert.equal(await said.count(), 1);
    assert.deepEqual(errors, []);
  });

  test("a lens out of focus is offered its focus", async (studio) => {
    const { page, errors } = await open(studio);
    await exact(page);
    const note = page.getByTestId("out-of-focus");
    assert.equal(await note.count(), 0);
    await defocus(page);
    await note.filter({ hasText: /lies\s+\d[\d.]* mm nearer to the lens/ }).waitFor();
    await note.getByRole("button", { name: "Focus" }).click();
    await at(page, 2);
    await exact(page);
    await note.waitFor({ state: "detached" });
    assert.deepEqual(errors, []);
  });

  test("a field that the lens refuses shows the lens again, and untouched numbers keep their digits", async (studio) => {
    const { page, errors } = await open(studio);
    await exact(page);
    const pupil = page.getByLabel("Entrance pupil, mm");
    const before = await pupil.inputValue();
    await pupil.fill("-5");
    await pupil.press("Tab");
    await page.getByRole("alert").getByText("not a positive number").waitFor();
    await page.waitForFunction((before) => [...document.querySelectorAll("input")].some((input) => input.value === before), before);
    assert.equal(await pupil.inputValue(), before);
    const fields = page.getByLabel("Fields, degrees");
    await fields.fill("0, 7.123456789, 12");
    await fields.press("Tab");
    await at(page, 1);
    await page.waitForFunction(() => [...document.querySelectorAll("input")].some((input) => input.value === "0, 7.12346, 12"));
    await fields.fill("0, 7.12346, 12, 13");
    await fields.press("Tab");
    await at(page, 2);
    assert.match(await toml(page), /angle_deg = \[0\.0, 7\.123456789, 12\.0, 13\.0\]/);
    // An empty radius is no plane.
    const curved = await radius(page).inputValue();
    await radius(page).fill("");
    await radius(page).press("Tab");
    await page.getByRole("alert").getByText("radius of surface 1: “” is no number").waitFor();
    assert.equal(await radius(page).inputValue(), curved);
    assert.deepEqual(errors, []);
  });

  test("changes of a form stay in the tab, and Back goes to the room before", async (studio) => {
    const { page, errors } = await open(studio);
    await tab(page, "Design").click();
    const form = page.getByRole("region", { name: "Experiment", exact: true });
    await form.getByText("as in its file").waitFor();
    await form.getByLabel("keys with the words").fill("training.batch");
    const batch = form.locator("[data-key='training.batch'] input");
    await batch.fill("2");
    await batch.press("Tab");
    // A check right after an edit is one of the edited experiment.
    await form.getByRole("button", { name: "Check" }).click();
    await form.getByText("1 changed").waitFor();
    await form.getByTestId("look").waitFor();
    await form.getByLabel("folder of the run").fill("runs/own");
    await page.reload();
    await form.getByText("1 changed").waitFor();
    await page.waitForFunction(() => [...document.querySelectorAll("input")].some((input) => input.value === "runs/own"));
    await tab(page, "Runs").click();
    await page.getByText("no runs in runs").waitFor();
    await page.goBack();
    await form.getByText("1 changed").waitFor();
    await page.goBack();
    await radius(page).waitFor();
    await page.evaluate(() => (location.hash = "#runs"));
    await page.getByText("no runs in runs").waitFor();
    assert.deepEqual(errors, []);
  });

  test("what a room has not computed without the studio is not said to be without light", async (studio) => {
    const { page } = await open(studio);
    await tab(page, "Camera").click();
    await page.getByTestId("chain").filter({ hasText: "exact:" }).waitFor();
    await page.reload();
    await page.getByTestId("chain").filter({ hasText: "exact:" }).waitFor();
    await studio.stop("SIGKILL");
    await page.getByRole("alert").getByText("The studio is not reached").waitFor();
    await tab(page, "Lens").click();
    await page.getByText("not computed: the studio is not reached").nth(2).waitFor();
    assert.equal(await page.getByText("no light reaches the image").count(), 0);
  });

  test("the mark of a number by the keyboard", async (studio) => {
    const { page, errors } = await open(studio);
    const before = await toml(page);
    await radius(page).focus();
    await page.keyboard.press("Alt+v");
    await at(page, 1);
    const after = await toml(page);
    assert.notEqual(after, before);
    await page.keyboard.press("Alt+v");
    await at(page, 2);
    assert.equal((await toml(page)).match(/\[\[variable\]\]/g)?.length, before.match(/\[\[variable\]\]/g)?.length);
    assert.deepEqual(errors, []);
  });

  test("a lens that is opened over unsaved changes leaves a way back, and a wrong file is named", async (studio) => {
    const { page, errors } = await open(studio);
    await radius(page).fill("25.5");
    await radius(page).press("Tab");
    await at(page, 1);
    const changed = await steps(page);
    await drop(page, "broken.zmx", "no lens");
    await page.getByRole("alert").filter({ hasText: "broken.zmx: this is not a lens" }).waitFor();
    assert.deepEqual(await steps(page), changed, "a file that is none changes nothing");
    const text = (await toml(page)).replace(/^name = .*$/m, 'name = "another"');
    await drop(page, "another.toml", text);
    await page.waitForFunction(() => document.querySelector("input.name")?.value === "another");
    await page.getByText("has changes that are not saved").waitFor();
    await page.getByRole("button", { name: "Go back to it" }).click();
    await at(page, 1);
    assert.deepEqual((await steps(page)).steps, changed.steps, "with its whole history");
    assert.deepEqual(errors, []);
  });

  test("a studio that is started with another lens shows that lens in the tab of the first", async (studio) => {
    const { page } = await open(studio);
    await radius(page).fill("25.5");
    await radius(page).press("Tab");
    await at(page, 1);
    const [first, changed] = [await name(page), await toml(page)];
    writeFileSync(join(studio.folder, "second.toml"), changed.replace(/^name = .*$/m, 'name = "second"'));
    await studio.stop("SIGKILL");
    const again = await startStudio(["--port", studio.port, join(studio.folder, "second.toml")], studio.folder);
    try {
      page.on("dialog", (dialog) => dialog.accept());
      await page.goto(again.url);
      await page.waitForFunction(() => document.querySelector("input.name")?.value === "second");
      await page.getByRole("button", { name: "Go back to it" }).click();
      await page.waitForFunction((first) => document.querySelector("input.name")?.value === first, first);
      assert.equal(await toml(page), changed);
    } finally {
      await again.stop();
    }
  });

  test("the camera room keeps its settings, and another lens has an array of its own", async (studio) => {
    const { page, errors } = await open(studio);
    await tab(page, "Camera").click();
    const chain = page.getByTestId("chain");
    await chain.filter({ hasText: "exact:" }).waitFor();
    const photo = page.getByLabel("Own photograph");
    const wrong = (text) => page.getByRole("alert").filter({ hasText: text });
    await photo.setInputFiles({ name: "none.png", mimeType: "image/png", buffer: Buffer.from("no picture") });
    await wrong("none.png: cannot decode the picture").waitFor();
    assert.equal(await page.getByLabel("Scene").inputValue(), "scene:siemens-star", "a file that is no picture is no scene");
    await page.getByLabel("Scene").selectOption("astronaut");
    await chain.filter({ hasText: "exact:" }).waitFor();
    await tab(page, "Lens").click();
    await radius(page).waitFor();
    await tab(page, "Camera").click();
    await chain.filter({ hasText: "exact:" }).waitFor();
    assert.equal(await page.getByLabel("Scene").inputValue(), "astronaut");
    // Half the focal length: half the image circle.
    const pixels = () => page.getByText(/\d+ × \d+ pixels of/).innerText();
    const columns = async () => Number((await pixels()).match(/^\d+/)[0]);
    const before = await columns();
    await tab(page, "Lens").click();
    const efl = page.getByLabel("Focal length, mm");
    await efl.fill(String(Number(await efl.inputValue()) / 2));
    await efl.press("Tab");
    await at(page, 1);
    const half = await toml(page);
    await page.getByRole("button", { name: "Undo" }).click();
    await at(page, 0);
    await tab(page, "Camera").click();
    await chain.filter({ hasText: "exact:" }).waitFor();
    assert.equal(await columns(), before);
    await drop(page, "half.toml", half);
    await page.waitForFunction((before) => Number(document.body.innerText.match(/(\d+) × \d+ pixels of/)?.[1] ?? before) < 0.6 * before, before);
    assert.deepEqual(errors, []);
  });

  test("what is wrong in a file is named with its line, key and value", async (studio) => {
    const { page, errors } = await open(studio);
    writeFileSync(join(studio.folder, "wrong.toml"), 'name = "Wrong"\nlens = "nolens.toml"\n');
    await tab(page, "Design").click();
    const name = page.getByRole("combobox", { name: /^experiment/ });
    await name.fill("wrong.toml");
    await name.press("Enter");
    await page.getByText(/wrong\.toml:2\b.*`lens = "?nolens\.toml"?`: neither a file nor built in/).waitFor();
    assert.deepEqual(errors, []);
  });

  test("tolerances: the figures of the command, and the worst lens on a click", async (studio) => {
    const { page, errors } = await open(studio);
    const panel = page.getByRole("region", { name: "Tolerances" });
    await panel.getByLabel("Lenses").fill("20");
    await panel.getByLabel("Limit of the merit").fill("13");
    await panel.getByRole("button", { name: "Make lenses" }).click();
    const found = page.getByTestId("tolerances");
    await found.waitFor();
    const [said, before] = [await found.innerText(), await toml(page)];
    writeFileSync(join(studio.folder, "own.toml"), before);
    const words = ["lens", "tolerance", "own.toml", "--grade", "precision", "--trials", "20", "--limit", "13", "--json"];
    const report = JSON.parse(execFileSync(PETZVAL, words, { cwd: studio.folder, encoding: "utf8" }));
    const { mean, yield_at_limit, worst } = report.monte_carlo;
    for (const [value, digits] of [
      [report.nominal, 4],
      [mean, 4],
      [worst[0].merit, 4],
    ]) {
      assert.ok(said.includes(String(Number(value.toPrecision(digits)))), `${value} in ${said}`);
    }
    assert.ok(said.includes(`${(100 * yield_at_limit).toFixed(1)} % reach 13`), `${yield_at_limit} in ${said}`);
    await found.getByRole("button", { name: `lens ${worst[0].trial},` }).click();
    await at(page, 1);
    assert.notEqual(await toml(page), before);
    await page.getByText("of a lens before").waitFor();
    await page.getByRole("button", { name: "Undo" }).click();
    await at(page, 0);
    assert.equal(await toml(page), before);
    assert.deepEqual(errors, []);
  });

  test("an optimisation can be cancelled after a visit to another room", async (studio) => {
    const { page, errors } = await open(studio);
    // So many beams that it does not converge while one is away, on however quick a machine.
    const steps = (count, from, to) => Array.from({ length: count }, (_, i) => (from + ((to - from) * i) / (count - 1)).toFixed(3)).join(", ");
    await page.getByLabel("Fields, degrees").fill(steps(60, 0, 14));
    await page.getByLabel("Fields, degrees").press("Enter");
    await at(page, 1);
    await page.getByLabel("Wavelengths, µm").fill(steps(30, 0.46, 0.66));
    await page.getByLabel("Wavelengths, µm").press("Enter");
    await at(page, 2);
    await page.getByLabel("Iterations").fill("100000");
    await page.getByRole("button", { name: "Optimise" }).click();
    await page.getByRole("button", { name: "Cancel" }).waitFor();
    await tab(page, "Runs").click();
    await page.getByRole("button", { name: "Cancel" }).waitFor({ state: "detached" });
    await page.getByText("no runs in runs").waitFor();
    await tab(page, "Lens").click();
    await page.getByRole("button", { name: "Cancel" }).click();
    await page.getByRole("button", { name: "Optimise" }).waitFor();
    assert.deepEqual(errors, []);
  });
}
