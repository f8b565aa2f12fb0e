// Scores for a reader: their headings and digits.

import type { RunRow, ScoreDescription } from "../lib/types";

/** The description of a score of a row. One that names itself alone is called by its name in words. */
export function described({ name, title = name.replaceAll("_", " "), unit = "", decimals = 4 }: RunRow["scores"][number]): Heading {
  return { name, title, unit, decimals };
}

type Heading = Pick<ScoreDescription, "name" | "title" | "unit" | "decimals">;

/** The heading of a column of scores. */
export const heading = ({ title, unit }: Heading) => (unit ? `${title}, ${unit}` : title);
