"""Networks that do what they should not."""

import os
import signal
import time
from pathlib import Path

import numpy as np
from tiny_nets import Restorer


class Marked(Restorer):
    """Leaves the number of its process in a file, and prints."""

    def __init__(self, *, marks, **rest):
        super().__init__(**rest)
        Path(marks).write_text(str(os.getpid()))

    def step(self, rate):
        print(f"step at {rate:.3g}")
        super().step(rate)


class Raises(Restorer):
    def backward(self, cotangent):
        raise ValueError("no way back")


class Nan(Restorer):
    def forward(self, x):
        return np.where(x[:, :3] < 2, np.nan, 0)


class Small(Restorer):
    def backward(self, cotangent):
        return cotangent


class Dies(Restorer):
    def step(self, rate):
        print("the device is lost")
        os.kill(os.getpid(), signal.SIGKILL)


class Hangs(Restorer):
    def step(self, rate):
        print("waiting for the device")
        time.sleep(3600)


class Forgetful(Restorer):
    def save(self):
        return "not bytes"


class Needy(Restorer):
    def __init__(self, **rest):
        raise KeyError("the key")


class Incomplete:
    def forward(self, x):
        return x[:, :3]


class Unscored:
    def loss(self, pictures, targets):
        return 0.0

    def score(self, pictures, targets):
        return [1.0]
