// Many small dots on a canvas: their pixels are written one by one, which takes a tenth of the time of as many calls of the canvas.

export type Rgb = [number, number, number];

/** Red, green and blue of a colour of CSS. */
export function rgbOf(css: string): Rgb {
  const context = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  if (!context) return [0, 0, 0];
  context.fillStyle = css;
  context.fillRect(0, 0, 1, 1);
  const [red, green, blue] = context.getImageData(0, 0, 1, 1).data;
  return [red ?? 0, green ?? 0, blue ?? 0];
}

/** A square picture of dots on nothing. */
export class Dots {
  readonly image: ImageData;

  constructor(private readonly side: number) {
    this.image = new ImageData(side, side);
  }

  /** A square dot about a place; pixels that it covers in part are covered in part. */
  dot(x: number, y: number, width: number, [red, green, blue]: Rgb): void {
    const { side, image } = this;
    const { data } = image;
    const [left, right, top, bottom] = [x - width / 2, x + width / 2, y - width / 2, y + width / 2];
    const [first, last] = [Math.max(Math.floor(left), 0), Math.min(Math.ceil(right), side)];
    const [high, low] = [Math.max(Math.floor(top), 0), Math.min(Math.ceil(bottom), side)];
    for (let row = high; row < low; row++) {
      const down = Math.min(row + 1, bottom) - Math.max(row, top);
      for (let column = first; column < last; column++) {
        const share = down * (Math.min(column + 1, right) - Math.max(column, left));
        const i = 4 * (row * side + column);
        const under = (data[i + 3]! / 255) * (1 - share);
        const opacity = share + under;
        if (opacity <= 0) continue;
        data[i] = (share * red + under * data[i]!) / opacity;
        data[i + 1] = (share * green + under * data[i + 1]!) / opacity;
        data[i + 2] = (share * blue + under * data[i + 2]!) / opacity;
        data[i + 3] = 255 * opacity;
      }
    }
  }
}
