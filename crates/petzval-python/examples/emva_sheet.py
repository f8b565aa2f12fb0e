"""A sensor measured from captures after EMVA 1288, as a table and as a page. Needs pandas.

The captures are simulated here; give the folder of your own in the command line.
"""

# %% Captures: pairs of flat and dark frames over exposure times.
import sys

import petzval as pz

folder = sys.argv[1] if len(sys.argv) > 1 else "captures"
if folder == "captures":
    pz.jobs.run("sensor-capture", {"sensor": "imx249-calibrated", "out": folder, "gains": [1], "size": [128, 128], "seed": 5})

# %% The sheet.
sheet = pz.characterize(folder)
gain = sheet["K"]
print(f"{gain.meaning}: {gain.value:.4f} +- {gain.standard_error:.4f} {gain.unit}")

# %% All figures of the green pixels.
table = sheet.to_frame()
green = table[(table.colour == "green") & table.value.notna()]
print(green[["section", "name", "value", "standard_error", "unit"]].head(12).to_string(index=False))

# %% The page, and a sensor file for simulations.
sheet.save_report("sheet.html")
with open("my-sensor.toml", "w", encoding="utf-8") as file:
    file.write(sheet.to_toml())
