// A studio and a browser for scripts: Debian's chromium by playwright-core, and the command that was built.

import { spawn } from "node:child_process";
import { mkdtempSync, readdirSync, rmSync } from "node:fs";
import { availableParallelism, loadavg, tmpdir } from "node:os";
import { extname, join, resolve } from "node:path";
import { chromium } from "playwright-core";

const ROOT = resolve(import.meta.dirname, "../../../..");
export const PETZVAL = process.env.PETZVAL ?? join(ROOT, "target/release/petzval");
export const CHROMIUM = process.env.CHROMIUM ?? "/usr/bin/chromium";

/** What Debian's chromium needs where it has no display, no user of its own and no network. */
export const FLAGS = [
  "--no-sandbox",
  "--disable-gpu",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
];

/** Starts a studio; its address is `url`. */
export async function startStudio(words = [], folder = mkdtempSync(join(tmpdir(), "petzval-studio-test-"))) {
  const child = spawn(PETZVAL, ["studio", "--no-open", "--folder", folder, ...words], { stdio: ["ignore", "pipe", "inherit"] });
  const url = await new Promise((found, failed) => {
    let text = "";
    child.stdout.on("data", (data) => {
      text += data;
      const address = text.match(/http:\S+token=\S+/);
      if (address) found(address[0]);
    });
    child.on("exit", (code) => failed(new Error(`the studio ended with ${code}: ${text}`)));
    child.on("error", failed);
  });
  const ended = new Promise((done) => child.on("exit", done));
  const stop = async (signal = "SIGTERM") => {
    child.kill(signal);
    await ended;
  };
  return { url, folder, stop, port: new URL(url).port, pid: child.pid };
}

/** A folder with the page as `npm run build` made it, in place of the one in the command: the page is tried without building the command anew. */
export const PAGE = process.env.PAGE;

/** The file of that folder for the address of a script or of styles, whose name in the command is another one. */
export function partOf(url) {
  const folder = join(PAGE, "assets");
  const ending = extname(new URL(url).pathname);
  return join(folder, readdirSync(folder).find((name) => name.endsWith(ending)));
}

/** Lets the pages of a context load their script and their styles from that folder, if one is named. */
export async function servePage(context) {
  if (PAGE) await context.route("**/assets/*", (route) => route.fulfill({ path: partOf(route.request().url()) }));
}

/** How many times as long as on a quiet machine something may take now: others may have the cores. */
export function slowness() {
  return Math.max(1, loadavg()[0] / availableParallelism());
}

/** Starts a browser. */
export function startBrowser() {
  return chromium.launch({ executablePath: CHROMIUM, args: FLAGS });
}

/** Deletes the folder of a studio. */
export function forget(folder) {
  rmSync(folder, { recursive: true, force: true });
}
