// The WebSocket to the server: calls with their answers, and live channels with one call in flight.

import { inFrame } from "./frame";
import type { ErrorReport, JobEvent, Place } from "./types";

/** A call that failed, with what the server says of it. */
export class CallError extends Error {
  constructor(readonly report: ErrorReport) {
    super(report.message);
  }

  /** Place, message and hint, for a reader. */
  get text(): string {
    return `${whereOf(this.report.place ?? {})}${this.plain}`;
  }

  /** Message and hint alone, for what stands beside the very value. */
  get plain(): string {
    const { message, hint } = this.report;
    return inPage(hint ? `${message} (${hint})` : message);
  }
}

/** What the command or a request calls otherwise than the page. */
const IN_PAGE: [RegExp, string][] = [
  [/`glasses` of the call reads/, "a studio that was started with `petzval studio --glasses FILE` reads"],
  [/resume it with `resume ([^`]+)`,? or choose another with `out`/, "open $1 and press Resume, or name another folder of the run"],
  [/give the folder that `petzval sweep` had as --store/, "name the folder of a sweep"],
];

/** A message in the words of the page. */
export const inPage = (text: string) => IN_PAGE.reduce((found, [words, own]) => found.replace(words, own), text);

/** What a message is about: file, line and column, key and value, as far as they are known. */
function whereOf({ path, line, column, key, value }: Place): string {
  const file = path && [path, line, column].filter((part) => part !== undefined).join(":");
  const what = [key, value].filter(Boolean).join(" = ");
  return [file, what && `\`${what}\``]
    .filter(Boolean)
    .map((part) => `${part}: `)
    .join("");
}

interface Message {
  id: number | null;
  event?: JobEvent;
  response?: unknown;
  error?: ErrorReport;
}

/** A message of bytes: the length of its text, the text, and what lies behind it. */
function unpacked(data: ArrayBuffer): [Message, Uint8Array<ArrayBuffer>] {
  const length = new DataView(data).getUint32(0, true);
  const text = new TextDecoder().decode(new Uint8Array(data, 4, length));
  return [JSON.parse(text) as Message, new Uint8Array(data, 4 + length)];
}

interface Waiting {
  resolve: (response: unknown) => void;
  reject: (error: CallError) => void;
  onEvent: ((event: JobEvent) => void) | undefined;
  bytes: string[];
}

/** A call at work. */
export interface Running<T> {
  response: Promise<T>;
  cancel: () => void;
}

interface Options {
  live?: string;
  /** Keys of the response that come as bytes in place of base64. */
  bytes?: string[];
  overwrite?: boolean;
  /** In a process of its own, which goes on without this page. */
  process?: boolean;
  onEvent?: (event: JobEvent) => void;
}

/** Milliseconds between two tries to reach the server again. */
const AGAIN_MS = 1000;

/** Milliseconds for which an answer waits to be shown together with one of the channel that leads. */
const TOGETHER_MS = 100;

/** Measurements that are kept. */
const MOST_MEASURED = 2000;

export class Server {
  /** Whether the server is reached. */
  connected = $state(false);
  /** Whether it was reached before and is gone now. */
  lost = $state(false);

  #socket: WebSocket | undefined;
  #waiting = new Map<number, Waiting>();
  #unsent: string[] = [];
  #next = 1;

  connect(): void {
    const socket = new WebSocket(`ws://${location.host}/socket`);
    this.#socket = socket;
    socket.onopen = () => {
      this.connected = true;
      this.lost = false;
      for (const text of this.#unsent.splice(0)) socket.send(text);
    };
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") this.#take(JSON.parse(data));
      else this.#take(...unpacked(data as ArrayBuffer));
    };
    socket.onclose = () => {
      this.connected = false;
      this.lost = true;
      const gone = { kind: "failed", message: "the connection to the studio is lost" };
      for (const { reject } of this.#waiting.values()) reject(new CallError(gone));
      this.#waiting.clear();
      this.#unsent = [];
      setTimeout(() => this.connect(), AGAIN_MS);
    };
  }

  /** Makes a call. */
  run<T>(job: string, request: object, { live, overwrite, bytes, process, onEvent }: Options = {}): Running<T> {
    const id = this.#next++;
    const response = new Promise<T>((resolve, reject) => {
      this.#waiting.set(id, { resolve: resolve as (response: unknown) => void, reject, onEvent, bytes: bytes ?? [] });
    });
    this.#send(JSON.stringify({ id, job, request, live, overwrite, bytes, process }));
    return { response, cancel: () => this.#send(JSON.stringify({ cancel: id })) };
  }

  /** The response of a call. */
  call<T>(job: string, request: object, options: Options = {}): Promise<T> {
    return this.run<T>(job, request, options).response;
  }

  #send(text: string): void {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(text);
    else this.#unsent.push(text);
  }

  #take(message: Message, behind?: Uint8Array<ArrayBuffer>): void {
    const waiting = message.id === null ? undefined : this.#waiting.get(message.id);
    if (!waiting || message.id === null) return;
    if (message.event) {
      waiting.onEvent?.(message.event);
      return;
    }
    this.#waiting.delete(message.id);
    if (message.error) {
      waiting.reject(new CallError(message.error));
      return;
    }
    if (behind) {
      const response = message.response as Record<string, unknown>;
      for (const key of waiting.bytes) {
        // Where its bytes begin, and how many they are; a key without bytes has a value of its own.
        if (!Array.isArray(response[key])) continue;
        const [from, count] = response[key] as [number, number];
        response[key] = behind.subarray(from, from + count);
      }
    }
    waiting.resolve(message.response);
  }
}

/** What a live channel asks for, and what becomes of the answer and of the warnings before it. */
export interface LiveCall<T> {
  job: string;
  request: object;
  /** Keys of the response that come as bytes. */
  bytes?: string[];
  done: (response: T, warnings: string[]) => void;
  failed?: (error: CallError) => void;
}

/**
 * One call in flight, and the newest state waits here. With a name it is a live channel of the server, whose calls have threads of their own; without
 * one its calls run beside other jobs.
 */
export class Live {
  #newest: LiveCall<never> | undefined;
  #busy = false;
  #measured = 0;
  /** Calls that were sent. */
  #sent = 0;
  /** The channel that this one must not outrun, how many of its calls come for one of this one, and the last that one stood beside. */
  #leader: Live | undefined;
  #every = 1;
  #beside = -1;
  readonly #led = new Set<Live>();
  /** What is to be shown with the next answer. */
  #companions: (() => void)[] = [];
  /** An answer that is to be shown in the next frame. */
  #unshown: { show: () => void; began: number } | undefined;

  constructor(
    private readonly server: Server,
    private readonly channel?: string,
  ) {}

  get isBusy(): boolean {
    return this.#busy;
  }

  /** Sends a call as soon as the one in flight is answered; one that waits already is dropped. */
  send<T>(call: LiveCall<T>): void {
    this.#newest = call as LiveCall<never>;
    void this.#go();
  }

  /** Drops a call that waits. */
  drop(): void {
    this.#newest = undefined;
  }

  /** While this channel is at work, the other one sends a call beside each of its own, or beside every so manyth: the cores are first of all for this one. */
  lead(other: Live, every = 1): () => void {
    other.#leader = this;
    other.#every = every;
    this.#led.add(other);
    return () => {
      other.#leader = undefined;
      this.#led.delete(other);
      void other.#go();
    };
  }

  #isHeld(): boolean {
    const leader = this.#leader;
    return leader !== undefined && leader.isBusy && leader.#sent < this.#beside + this.#every;
  }

  async #go(): Promise<void> {
    if (this.#busy) return;
    this.#busy = true;
    while (this.#newest && !this.#isHeld()) {
      const { job, request, bytes, done, failed } = this.#newest;
      this.#newest = undefined;
      this.#sent += 1;
      if (this.#leader) this.#beside = this.#leader.#sent;
      const began = performance.now();
      const warnings: string[] = [];
      const onEvent = (event: JobEvent) => {
        if (event.event === "warning") warnings.push(event.text);
      };
      try {
        const options = { onEvent, ...(this.channel === undefined ? {} : { live: this.channel }), ...(bytes ? { bytes } : {}) };
        const answer = this.server.call<never>(job, request, options);
        for (const other of this.#led) void other.#go();
        const response = await answer;
        this.#show(() => done(response, warnings), began);
      } catch (error) {
        // What was to be shown before is older than the failure.
        this.#unshown = undefined;
        if (error instanceof CallError) failed?.(error);
        else reportError(error);
      }
    }
    this.#busy = false;
    for (const other of this.#led) void other.#go();
  }

  /** Shows an answer in the next frame, or with the answer of the channel that leads; of two that wait, the newer one. */
  #show(show: () => void, began: number): void {
    for (const together of this.#companions.splice(0)) together();
    const isWaiting = this.#unshown !== undefined;
    this.#unshown = { show, began };
    if (isWaiting) return;
    const next = () => {
      let shown: number | undefined;
      inFrame(
        () => {
          const newest = this.#unshown;
          this.#unshown = undefined;
          newest?.show();
          shown = newest?.began;
        },
        () => {
          if (shown !== undefined) this.#measure(shown);
        },
      );
    };
    const leader = this.#leader;
    if (leader?.isBusy) leader.#accompany(next);
    else next();
  }

  /** Does something with the next answer of this channel, if that does not take long. */
  #accompany(what: () => void): void {
    let timer: ReturnType<typeof setTimeout> | undefined;
    const together = () => {
      if (timer === undefined) return;
      clearTimeout(timer);
      timer = undefined;
      what();
    };
    timer = setTimeout(together, TOGETHER_MS);
    this.#companions.push(together);
  }

  /** Notes how long it took from the sending of a call until its answer stood on the page, for the tools of the browser and for `npm run measure`. */
  #measure(began: number): void {
    if (this.channel === undefined) return;
    const name = `live ${this.channel}`;
    if (++this.#measured % MOST_MEASURED === 0) performance.clearMeasures(name);
    performance.measure(name, { start: began, end: performance.now() });
  }
}

export const server = new Server();
