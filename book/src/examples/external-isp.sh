# A picture from the green pixels of each block of RGGB, with black level, gain and gamma.
number() { sed -n "s/^\"*$1\"* = //p" "$2/frame.toml"; }
od -An -v -t u4 -w4 "$1/raw.bin" | awk \
    -v height="$(number height "$1")" -v width="$(number width "$1")" \
    -v black="$(number black_dn "$1")" -v white="$(number white_dn "$1")" \
    -v gain="$(number tone.gain "$1")" -v gamma="$(number tone.gamma "$1")" '
    { light = gain * ($1 - black) / (white - black); light = light < 0 ? 0 : light > 1 ? 1 : light
      value[NR - 1] = int(255 * light ^ (1 / gamma) + 0.5) }
    END { print "P3", width, height, 255
          for (row = 0; row < height; row++) for (col = 0; col < width; col++) {
              v = value[(row - row % 2) * width + col - col % 2 + 1]; print v, v, v } }' > "$1/rgb.ppm"
