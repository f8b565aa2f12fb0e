"""The Python of the manual: the blocks of a page, run one after the other."""

import os
import re
import warnings
from pathlib import Path
from typing import Any

import petzval as pz

ROOT = Path(__file__).parents[3]
BOOK = ROOT / "book" / "src"


def pages() -> dict[str, list[str]]:
    """The blocks of Python of every page that has some, by the path of the page."""
    found = {}
    for page in [ROOT / "README.md", ROOT / "crates/petzval-python/README.md", *sorted(BOOK.rglob("*.md"))]:
        blocks = re.findall(r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"), flags=re.M | re.S)
        if blocks:
            found[page.relative_to(ROOT).as_posix()] = blocks
    return found


def run(blocks: list[str], folder: Path, **known: Any) -> dict[str, Any]:
    """Runs blocks in a folder; they share names, and begin with those that are known. Returns the names."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pz.PetzvalWarning)
            for number, block in enumerate(blocks):
                exec(compile(block, f"block {number}", "exec"), known)
    finally:
        os.chdir(before)
    return known
