// The WebSocket to the server: calls with their answers, and live channels with one call in flight.

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
    return hint ? `${message} (${hint})` : message;
  }
}

/** What a message is about: file, line and column, key and value, as far as they are known. */
function whereOf({ path, line, column, key, value }: Place): string {
  const file = path && [path, line, column].filter((part) => part !== undefined).join(":");
  const what = [key, value].filter(Boolean).join(" = ");
  return [file, what && `\`${what}\``]
    .filter(Boolean)
    .map((part) => `${part}: `)
    .join("");
}

interface Waiting {
  resolve: (response: unknown) => void;
  reject: (error: CallError) => void;
  onEvent: ((event: JobEvent) => void) | undefined;
}

/** A call at work. */
export interface Running<T> {
  response: Promise<T>;
  cancel: () => void;
}

interface Options {
  live?: string;
  overwrite?: boolean;
  /** In a process of its own, which goes on without this page. */
  process?: boolean;
  onEvent?: (event: JobEvent) => void;
}

/** Milliseconds between two tries to reach the server again. */
const AGAIN_MS = 1000;

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
    socket.onmessage = ({ data }) => this.#take(JSON.parse(data as string));
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
  run<T>(job: string, request: object, { live, overwrite, process, onEvent }: Options = {}): Running<T> {
    const id = this.#next++;
    const response = new Promise<T>((resolve, reject) => {
      this.#waiting.set(id, { resolve: resolve as (response: unknown) => void, reject, onEvent });
    });
    this.#send(JSON.stringify({ id, job, request, live, overwrite, process }));
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

  #take(message: { id: number | null; event?: JobEvent; response?: unknown; error?: ErrorReport }): void {
    const waiting = message.id === null ? undefined : this.#waiting.get(message.id);
    if (!waiting || message.id === null) return;
    if (message.event) {
      waiting.onEvent?.(message.event);
      return;
    }
    this.#waiting.delete(message.id);
    if (message.error) waiting.reject(new CallError(message.error));
    else waiting.resolve(message.response);
  }
}

/** What a live channel asks for, and what becomes of the answer and of the warnings before it. */
export interface LiveCall<T> {
  job: string;
  request: object;
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

  constructor(
    private readonly server: Server,
    private readonly channel?: string,
  ) {}

  /** Sends a call as soon as the one in flight is answered; one that waits already is dropped. */
  send<T>(call: LiveCall<T>): void {
    this.#newest = call as LiveCall<never>;
    void this.#go();
  }

  /** Drops a call that waits. */
  drop(): void {
    this.#newest = undefined;
  }

  async #go(): Promise<void> {
    if (this.#busy) return;
    this.#busy = true;
    while (this.#newest) {
      const { job, request, done, failed } = this.#newest;
      this.#newest = undefined;
      const began = performance.now();
      const warnings: string[] = [];
      const onEvent = (event: JobEvent) => {
        if (event.event === "warning") warnings.push(event.text);
      };
      try {
        const options = this.channel === undefined ? { onEvent } : { live: this.channel, onEvent };
        const response = await this.server.call<never>(job, request, options);
        done(response, warnings);
        this.#measure(began);
      } catch (error) {
        if (error instanceof CallError) failed?.(error);
        // A fault of the page is one of this answer: the channel goes on with the next.
        else reportError(error);
      }
    }
    this.#busy = false;
  }

  /** Notes how long a call took, with what was done with its answer, for the tools of the browser and for `npm run measure`. */
  #measure(began: number): void {
    if (this.channel === undefined) return;
    const name = `live ${this.channel}`;
    if (++this.#measured % MOST_MEASURED === 0) performance.clearMeasures(name);
    performance.measure(name, { start: began, end: performance.now() });
  }
}

export const server = new Server();
