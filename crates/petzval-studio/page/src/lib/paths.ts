// Files of the studio's folder, as the page names and loads them.

/** The address of a file of the folder. */
export function fileUrl(path: string): string {
  return `files/${path.replace(/^\.\//, "").split("/").map(encodeURIComponent).join("/")}`;
}

/** A path below a folder; the path itself if it lies elsewhere. */
export function below(path: string, folder: string): string {
  const prefix = folder.endsWith("/") ? folder : `${folder}/`;
  return path.startsWith(prefix) ? path.slice(prefix.length) : path;
}

/** A path for a reader: digests in it, by which stores name units, are cut. */
export function brief(path: string): string {
  return path.replace(/[0-9a-f]{64}/g, (digest) => `${digest.slice(0, 8)}…`);
}

/** Seconds in words. */
export function time(seconds: number): string {
  const whole = Math.max(0, Math.round(seconds));
  const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
  if (hours > 0) return `${hours} h ${String(minutes).padStart(2, "0")} min`;
  return minutes > 0 ? `${minutes} min ${String(whole % 60).padStart(2, "0")} s` : `${seconds.toFixed(1)} s`;
}
