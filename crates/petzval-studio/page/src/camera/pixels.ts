// Pixels from the server, on a canvas.

export interface Pixels {
  width: number;
  height: number;
  /** Red, green, blue and opacity of each pixel. */
  rgba: Uint8ClampedArray<ArrayBuffer>;
}

/** A browser that decodes base64 itself does it several times as fast. */
interface Decoder {
  fromBase64?: (text: string) => Uint8Array;
}

function bytesOf(base64: string): Uint8Array {
  const own = (Uint8Array as unknown as Decoder).fromBase64;
  if (own) return own.call(Uint8Array, base64);
  const text = atob(base64);
  return Uint8Array.from({ length: text.length }, (_, i) => text.charCodeAt(i));
}

/** Pixels of 8 bits, one (gray) or three (RGB) values each, of which text is base64. They take the place of `old` ones of the same number. */
export function pixelsOf(values: string | Uint8Array, width: number, height: number, each: 1 | 3, old?: Pixels): Pixels {
  const bytes = typeof values === "string" ? bytesOf(values) : values;
  const length = 4 * width * height;
  const rgba = old?.rgba.length === length ? old.rgba : new Uint8ClampedArray(length);
  // A pixel is one number: the lowest byte, which comes first, is red.
  const pixels = new Uint32Array(rgba.buffer);
  if (each === 1) {
    for (let i = 0; i < pixels.length; i++) pixels[i] = 0xff000000 | (0x010101 * bytes[i]!);
  } else {
    for (let i = 0, from = 0; i < pixels.length; i++, from += 3) {
      pixels[i] = 0xff000000 | bytes[from]! | (bytes[from + 1]! << 8) | (bytes[from + 2]! << 16);
    }
  }
  return { width, height, rgba };
}

/** Root mean square of the differences of the values of two pictures, of 255. */
export function differenceOf(a: Pixels, b: Pixels): number | undefined {
  if (a.width !== b.width || a.height !== b.height) return undefined;
  let sum = 0;
  for (let i = 0; i < a.rgba.length; i++) {
    const by = a.rgba[i]! - b.rgba[i]!;
    sum += by * by;
  }
  // Opacities are equal.
  return Math.sqrt(sum / ((3 / 4) * a.rgba.length));
}

/** Draws a picture, and another one over its left share. */
export function draw(canvas: HTMLCanvasElement, picture: Pixels, over: Pixels | undefined, share: number): void {
  const { width, height } = picture;
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
    canvas.style.aspectRatio = `${width} / ${height}`;
  }
  const context = canvas.getContext("2d");
  if (!context) return;
  context.putImageData(new ImageData(picture.rgba, width, height), 0, 0);
  if (!over || share === 0 || over.width !== width || over.height !== height) return;
  const columns = Math.round(share * width);
  if (columns > 0) context.putImageData(new ImageData(over.rgba, width, height), 0, 0, 0, 0, columns, height);
  if (columns > 0 && columns < width) {
    context.fillStyle = "#ffffff";
    context.fillRect(columns - 1, 0, 1, height);
  }
}
