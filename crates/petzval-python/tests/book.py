"""The Python of the manual: the blocks of a page, run one after the other in a folder of their own.

The first line of a block may say how it runs, as ``crates/petzval/tests/book/blocks/mod.rs`` explains: ``short=OPTIONS``, ``skip=REASON``,
``file=NAME``. Blocks of the shell run as well where a page has Python, which may need what they write.
"""

import os
import re
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import petzval as pz

ROOT = Path(__file__).parents[3]
BOOK = ROOT / "book" / "src"
DATA = ROOT / "crates" / "petzval-data" / "data"
SHIM = ROOT / "crates/petzval/tests/book/blocks/petzval.sh"


@dataclass
class Block:
    """A fenced block."""

    line: int
    language: str
    text: str
    skip: str | None
    file: str | None
    short: str

    @property
    def needs_torch(self) -> bool:
        return self.skip == "torch" or "torch" in self.text

    @property
    def is_run(self) -> bool:
        return self.skip in (None, "torch") and self.file is None


def blocks(text: str) -> list[Block]:
    """The blocks of the shell, of TOML and of Python of a page, in order."""
    found = []
    for match in re.finditer(r"^```(sh|toml|python)\b[, ]*([^\n]*)\n(.*?)^```$", text, flags=re.M | re.S):
        keys, short = (match[2].split("short=", 1) + [""])[:2]
        said = dict(re.findall(r"(\w+)=([^\s,]+)", keys))
        line = text.count("\n", 0, match.start()) + 1
        found.append(Block(line, match[1], match[3], said.get("skip"), said.get("file"), short))
    return found


def pages() -> dict[str, list[Block]]:
    """The blocks of every page whose Python is run, by the path of the page."""
    found = {}
    for page in [ROOT / "README.md", ROOT / "crates/petzval-python/README.md", *sorted(BOOK.rglob("*.md"))]:
        of_page = blocks(page.read_text(encoding="utf-8")) if page.is_file() else []
        if any(block.language == "python" and block.is_run for block in of_page):
            found[page.relative_to(ROOT).as_posix()] = of_page
    return found


def names(*, with_torch: bool) -> list[str]:
    """The pages with Python that needs PyTorch, or those with Python that does not."""
    python = {name: [b for b in of if b.language == "python" and b.is_run] for name, of in pages().items()}
    return [name for name, of in python.items() if any(b.needs_torch == with_torch for b in of)]


def _nominal(folder: Path) -> None:
    pz.jobs.run("psf", {"lens": "cooke-triplet-nominal", "out": folder / "psf-nominal"})


def _lens(name: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        shutil.copy(ROOT / "crates/petzval/tests/lenses/double-gauss.zmx", folder / name)

    return make


def _pictures(name: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        (folder / name).mkdir()
        for picture in ("astronaut", "chelsea", "china", "coffee"):
            shutil.copy(DATA / "photos" / f"{picture}.png", folder / name)

    return make


# What a page may name as its reader's own, or as what a text before the block shows, and how it comes to be here.
READY: dict[str, Callable[[Path], None]] = {
    "psf-nominal": _nominal,
    "double-gauss.zmx": _lens("double-gauss.zmx"),
    "my-lens.zmx": _lens("my-lens.zmx"),
    **{name: _pictures(name) for name in ("my-pictures", "my-photos", "photos")},
}


def run(name: str, folder: Path, *, with_torch: bool) -> dict[str, Any]:
    """Runs the blocks of a page in a folder, with those that need PyTorch or without; returns the names of its Python."""
    of_page = pages()[name]
    text = "".join(block.text for block in of_page)
    for file, make in READY.items():
        if re.search(rf"[\"' ]{re.escape(file)}\b", text):
            make(folder)
    known: dict[str, Any] = {"psfs": np.ones((3, 3, 32, 32)), "__name__": "__page__"}
    before = Path.cwd()
    os.chdir(folder)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pz.PetzvalWarning)
            for block in of_page:
                if block.file is not None:
                    Path(block.file).write_text(block.text, encoding="utf-8")
                if not block.is_run or (block.needs_torch and not with_torch):
                    continue
                if block.language == "python":
                    exec(compile(shortened(block), f"{name}:{block.line}", "exec"), known)
                elif block.language == "sh":
                    shell(block)
    finally:
        os.chdir(before)
    return known


def shortened(block: Block) -> str:
    """The text of a block of Python, with the line that its fence gives in place of the one that sets the same names."""
    if not block.short or os.environ.get("PETZVAL_WHOLE_BOOK"):
        return block.text
    names = block.short.split(" = ")[0]
    text, count = re.subn(rf"^{re.escape(names)} = .*$", block.short, block.text, flags=re.M)
    assert count == 1, f"{block.short}: line {block.line} sets {names} {count} times"
    return text


def shell(block: Block) -> None:
    """Runs commands; ``petzval`` is the command of this package."""
    programs = Path("programs-of-the-page").resolve()
    programs.mkdir(exist_ok=True)
    for program, script in [("petzval", SHIM.read_text()), ("this-package", f'#!/bin/sh\nexec "{sys.executable}" -m petzval "$@"\n')]:
        (programs / program).write_text(script)
        (programs / program).chmod(0o755)
    environment = {
        **os.environ,
        "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
        "PETZVAL_PROGRAM": str(programs / "this-package"),
        "PETZVAL_SHORT": block.short.replace("tiny", ""),
    }
    subprocess.run(["sh", "-e", "-c", block.text], check=True, env=environment, stdin=subprocess.DEVNULL)
