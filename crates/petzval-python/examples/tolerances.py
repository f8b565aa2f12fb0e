"""What errors of making do to a lens, as tables. Needs pandas."""

# %% Random lenses of a commercial grade.
import pandas as pd

import petzval as pz

lens = pz.Lens.load("cooke-triplet-nominal")
tolerance = lens.tolerance(grade="commercial", trials=200, seed=1)

# %% One row a lens.
trials = pd.DataFrame(tolerance.trials)
merit = next(column for column in trials.columns if column.startswith("merit"))
print(trials[merit].describe(percentiles=[0.5, 0.9]).round(2))

# %% One row an error, the greatest effect first.
errors = pd.DataFrame(tolerance.sensitivities)
print(errors.sort_values("merit_at_plus", ascending=False)[["name", "unit", "merit_at_plus"]].head(8).to_string(index=False))

# %% The worst lens, to look at.
worst = tolerance.lens(int(trials[merit].idxmax()))
worst.save("worst.toml")
print("RMS spot radius, um, as drawn:", lens.spots().rms_um.round(1), "worst:", worst.spots().rms_um.round(1))
