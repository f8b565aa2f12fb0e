import { svelte } from "@sveltejs/vite-plugin-svelte";
import { defineConfig } from "vite";

// The built files are committed: no time, path or random number of the machine goes into them.
export default defineConfig({
  plugins: [svelte()],
  base: "./",
  build: { target: "es2022", sourcemap: false, modulePreload: false, reportCompressedSize: true },
});
