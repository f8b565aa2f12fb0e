"""A design, and its figures: scores as a table, losses as a plot. Needs pandas and Matplotlib."""

# %% A short run of the main job, where there is none yet.
from pathlib import Path

import pandas as pd

import petzval as pz

RUN = "run"  # or the folder of your own

if not Path(RUN).is_dir():
    changes = {"seed": 1, "steps": 20}
    pz.jobs.run("design", {"run": {"new": {"experiment": "cooke-triplet-image-quality", "changes": changes, "out": RUN}}})

# %% One row a camera.
run = pz.Run(RUN)
scores = pd.DataFrame(run.rows).set_index("camera")
print(scores[["one_minus_lpips", "psnr_db", "rms_spot_um"]].round(3).to_string())

# %% Losses over the steps.
import matplotlib.pyplot as plt

steps = pd.DataFrame([{"camera": e["camera"], "block": e["block"], "step": e["step"], **e["losses"]} for e in run.events() if e.get("losses")])
figure, axes = plt.subplots(figsize=(7, 4))
for camera, part in steps[steps.block == "network"].groupby("camera"):
    axes.plot(range(len(part)), part.total, label=camera)
axes.set(xlabel="step of the network", ylabel="loss", yscale="log")
axes.legend()
figure.savefig("losses.png", dpi=120)
print(len(steps), "steps; losses.png is written")
