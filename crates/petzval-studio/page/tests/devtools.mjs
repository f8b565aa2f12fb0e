// A browser for measurements: Debian's chromium by its own protocol over a pipe, and nothing that looks on. playwright listens to the network of each
// page: of every picture that comes, its bytes go as text through browser and node, which takes as long as to show it.

import { spawn } from "node:child_process";
import { mkdtempSync, readFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { CHROMIUM, FLAGS, PAGE, forget, partOf } from "./browser.mjs";

/** Opens an address in a window of so many pixels. */
export async function openWindow(url, width, height) {
  const profile = mkdtempSync(join(tmpdir(), "petzval-studio-browser-"));
  const words = [...FLAGS, "--headless", "--remote-debugging-pipe", `--user-data-dir=${profile}`, "about:blank"];
  const child = spawn(CHROMIUM, words, { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });
  const waiting = new Map();
  let [next, text] = [1, ""];
  child.stdio[4].setEncoding("utf8").on("data", (data) => {
    const messages = (text + data).split("\0");
    text = messages.pop();
    for (const { id, result, error, method, params } of messages.map((message) => JSON.parse(message))) {
      if (method === "Fetch.requestPaused") servePart(params);
      const { done, failed } = waiting.get(id) ?? {};
      waiting.delete(id);
      if (error) failed?.(new Error(error.message));
      else done?.(result);
    }
  });
  const ended = new Promise((done) => child.on("exit", done));
  void ended.then(() => waiting.forEach(({ failed }) => failed(new Error("the browser ended"))));
  const send = (method, params = {}, sessionId) =>
    new Promise((done, failed) => {
      waiting.set(next, { done, failed });
      child.stdio[3].write(`${JSON.stringify({ id: next++, method, params, sessionId })}\0`);
    });

  const { targetId } = await send("Target.createTarget", { url: "about:blank" });
  const { sessionId } = await send("Target.attachToTarget", { targetId, flatten: true });
  const toPage = (method, params) => send(method, params, sessionId);
  await toPage("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: false });
  // The page as it was built, in place of the one in the command.
  function servePart({ requestId, request }) {
    const part = partOf(request.url);
    const type = part.endsWith(".css") ? "text/css" : "text/javascript";
    const responseHeaders = [{ name: "Content-Type", value: type }];
    void toPage("Fetch.fulfillRequest", { requestId, responseCode: 200, responseHeaders, body: readFileSync(part, "base64") });
  }
  if (PAGE) await toPage("Fetch.enable", { patterns: [{ urlPattern: "*/assets/*" }] });
  await toPage("Page.navigate", { url });

  /** The value of an expression in the page. */
  async function evaluate(expression) {
    const { result, exceptionDetails } = await toPage("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
    if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    return result.value;
  }

  return {
    pid: child.pid,
    evaluate,
    /** Waits until an expression holds. */
    async until(expression, seconds = 120) {
      for (const began = performance.now(); performance.now() - began < 1000 * seconds; ) {
        if (await evaluate(`Boolean(${expression})`).catch(() => false)) return;
        await new Promise((done) => setTimeout(done, 200));
      }
      throw new Error(`not within ${seconds} s: ${expression}`);
    },
    /** Moves, presses or releases the mouse. */
    mouse: (type, x, y, buttons) => toPage("Input.dispatchMouseEvent", { type, x, y, buttons, button: buttons || type === "mouseReleased" ? "left" : "none", clickCount: type === "mouseMoved" ? 0 : 1 }),
    async press(key) {
      for (const type of ["keyDown", "keyUp"]) await toPage("Input.dispatchKeyEvent", { type, key });
    },
    async close() {
      await send("Browser.close").catch(() => {});
      await ended;
      forget(profile);
    },
  };
}
