// Values that stay: what an answer repeats is kept as it was, so that nothing which shows it is drawn again.

/** The value `now`, with every part of it that equals that of `before` taken from there; `before` itself if they are equal. */
export function alike<T>(before: T, now: T): T {
  if (Object.is(before, now) || typeof before !== "object" || typeof now !== "object" || before === null || now === null) return now;
  if (Array.isArray(before) !== Array.isArray(now)) return now;
  const [old, found] = [before as Record<string, unknown>, now as Record<string, unknown>];
  const keys = Object.keys(found);
  let isEqual = keys.length === Object.keys(old).length;
  for (const key of keys) {
    const kept = alike(old[key], found[key]);
    if (!Object.is(kept, old[key]) || !(key in old)) isEqual = false;
    found[key] = kept;
  }
  return isEqual ? before : now;
}
