// Lens files: their formats by their endings, and files that the browser saves.

export type LensFormat = "toml" | "zmx" | "seq" | "json";

/** The format of a lens file by its name; undefined if it is none. */
export function formatOf(name: string): LensFormat | undefined {
  const ending = name.slice(name.lastIndexOf(".") + 1).toLowerCase();
  return (["toml", "zmx", "seq", "json"] as const).find((format) => format === ending);
}

/** Whether a file is a picture: by its type, or by its ending where the system names no type. */
export const isPicture = ({ name, type }: File) => type.startsWith("image/") || /\.(png|jpe?g|tiff?|exr|hdr|p[bgnp]m|webp|bmp|gif)$/i.test(name);

/** The text of a file in UTF-8, or in UTF-16 with its byte order mark, as Zemax writes it. Other bytes are Latin-1. */
export async function textOf(file: Blob): Promise<string> {
  const bytes = new Uint8Array(await file.arrayBuffer());
  if (bytes[0] === 0xff && bytes[1] === 0xfe) return new TextDecoder("utf-16le").decode(bytes);
  if (bytes[0] === 0xfe && bytes[1] === 0xff) return new TextDecoder("utf-16be").decode(bytes);
  try {
    return new TextDecoder("utf-8", { fatal: true }).decode(bytes);
  } catch {
    return new TextDecoder("windows-1252").decode(bytes);
  }
}

/** Lets the browser save a text as a file. */
export function download(name: string, text: string): void {
  const url = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}
