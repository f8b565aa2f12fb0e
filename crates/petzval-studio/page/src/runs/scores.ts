// Scores for a reader: their headings.

import type { ScoreDescription } from "../lib/types";

/** The heading of a column of scores. */
export const heading = ({ title, unit }: Pick<ScoreDescription, "title" | "unit">) => (unit ? `${title}, ${unit}` : title);
