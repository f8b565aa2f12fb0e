"""A sensor measured from captures after EMVA 1288, as a table and as a page. Needs pandas."""

# %% Captures: pairs of flat and dark frames over exposure times.
from pathlib import Path

import petzval as pz

CAPTURES = "captures"  # the folder of your own; simulated here where there is none

if not Path(CAPTURES).is_dir():
    pz.jobs.run("sensor-capture", {"sensor": "imx249-calibrated", "out": CAPTURES, "gains": [1], "size": [128, 128], "seed": 5})

# %% The sheet.
sheet = pz.characterize(CAPTURES)
gain = sheet["K"]
print(f"{gain.meaning}: {gain.value:.4f} +- {gain.standard_error:.4f} {gain.unit}")
sheet  # a notebook shows the sheet

# %% All figures of the green pixels.
table = sheet.to_frame()
green = table[(table.colour == "green") & table.value.notna()]
print(green[["section", "name", "value", "standard_error", "unit"]].head(12).to_string(index=False))

# %% The page, and a sensor file for simulations.
sheet.save_report("sheet.html")
Path("my-sensor.toml").write_text(sheet.to_toml(), encoding="utf-8")
