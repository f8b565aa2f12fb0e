// Pixels from the server, on a canvas.

export interface Pixels {
  width: number;
  height: number;
  /** Red, green, blue and opacity of each pixel. */
  rgba: Uint8ClampedArray<ArrayBuffer>;
}

/** Decodes pixels of 8 bits, one (gray) or three (RGB) values each. */
export function pixelsOf(base64: string, width: number, height: number, values: 1 | 3): Pixels {
  const bytes = atob(base64);
  const rgba = new Uint8ClampedArray(4 * width * height);
  for (let i = 0, from = 0; i < width * height; i++, from += values) {
    rgba[4 * i] = bytes.charCodeAt(from);
    rgba[4 * i + 1] = bytes.charCodeAt(values === 3 ? from + 1 : from);
    rgba[4 * i + 2] = bytes.charCodeAt(values === 3 ? from + 2 : from);
    rgba[4 * i + 3] = 255;
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
