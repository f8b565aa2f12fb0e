// What lies in the window: what does not need not be drawn while one drags.

const watched = new WeakMap<Element, (isSeen: boolean) => void>();

/** Begins to see things a little before they come into the window. */
const AHEAD = "80px";

const observer = new IntersectionObserver(
  (entries) => {
    for (const { target, isIntersecting } of entries) watched.get(target)?.(isIntersecting);
  },
  { rootMargin: AHEAD },
);

/** Says of an element whether it lies in the window, now and whenever that changes. */
export function whileSeen(element: Element, say: (isSeen: boolean) => void) {
  watched.set(element, say);
  observer.observe(element);
  return {
    update: (other: (isSeen: boolean) => void) => void watched.set(element, other),
    destroy: () => {
      observer.unobserve(element);
      // What shows it elsewhere begins anew.
      watched.get(element)?.(true);
    },
  };
}
