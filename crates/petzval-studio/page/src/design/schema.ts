// A JSON Schema of an experiment, as much of it as a form needs.

export interface Schema {
  $ref?: string;
  $defs?: Record<string, Schema>;
  type?: string | string[];
  properties?: Record<string, Schema>;
  additionalProperties?: boolean | Schema;
  items?: Schema;
  oneOf?: Schema[];
  anyOf?: Schema[];
  const?: string;
  enum?: string[];
  default?: unknown;
  description?: string;
  minimum?: number;
  maximum?: number;
}

/** What a form shows of a key. */
export type Kind = "number" | "integer" | "boolean" | "choice" | "text" | "list" | "table" | "tables";

export interface Key {
  kind: Kind;
  schema: Schema;
  /** Choices with their sentences. */
  choices: { value: string; about: string }[];
  isOptional: boolean;
  about: string;
}

/** The schema behind references, and of what may be left out. */
export function resolved(schema: Schema, root: Schema): Schema {
  let found = schema;
  const own = schema;
  for (let i = 0; i < 8; i++) {
    if (found.$ref) found = root.$defs?.[found.$ref.split("/").at(-1)!] ?? {};
    else if (found.anyOf) found = found.anyOf.find((part) => part.type !== "null") ?? {};
    else break;
  }
  return { ...found, ...(own.default === undefined ? {} : { default: own.default }), ...(own.description ? { description: own.description } : {}) };
}

/** How a key is shown. */
export function keyOf(schema: Schema, root: Schema): Key {
  const whole = resolved(schema, root);
  const types = [whole.type ?? []].flat();
  const type = types.find((name) => name !== "null");
  const isOptional = schema.anyOf !== undefined || types.includes("null");
  const constants = (whole.oneOf ?? []).filter((part) => part.const !== undefined || part.enum);
  const choices = constants.flatMap((part) => (part.enum ?? [part.const!]).map((value) => ({ value, about: part.description ?? "" })));
  const named = choices.length > 0 ? choices : (whole.enum ?? []).map((value) => ({ value, about: "" }));
  const item = whole.items ? resolved(whole.items, root) : undefined;
  const isMap = type === "object" && !whole.properties;
  const kind: Kind =
    named.length > 0
      ? "choice"
      : type === "object" && !isMap
        ? "table"
        : type === "array" && item?.properties
          ? "tables"
          : type === "array" || isMap
            ? "list"
            : type === "number" || type === "integer" || type === "boolean"
              ? type
              : "text";
  return { kind, schema: whole, choices: named, isOptional, about: (schema.description ?? whole.description ?? "").replaceAll("\n", " ") };
}

/** The range of a number in words. */
export function range({ minimum, maximum }: Schema): string {
  if (minimum === undefined && maximum === undefined) return "";
  return `${minimum ?? "−∞"} to ${maximum ?? "∞"}`;
}

/** The unit that the sentence of a key ends with. */
export function unit(about: string): string {
  return about.match(/Unit: ([^.]+)\.?$/)?.[1] ?? "";
}

export function isSame(a: unknown, b: unknown): boolean {
  return JSON.stringify(a) === JSON.stringify(b);
}

/** Whether a key, or one below it, has the words in its path or in its sentence. */
export function matches(path: string, schema: Schema, root: Schema, words: string): boolean {
  if (!words) return true;
  const key = keyOf(schema, root);
  const parts = key.kind === "table" ? key.schema.properties : key.kind === "tables" && key.schema.items ? resolved(key.schema.items, root).properties : undefined;
  if (!parts) return `${path} ${key.about}`.toLowerCase().includes(words);
  return Object.entries(parts).some(([name, part]) => matches(`${path}.${name}`, part, root, words));
}
