"""Makes a notebook of every example, and runs it, so that it shows its output.

    python write_notebooks.py [NAME ...]     # needs nbclient and ipykernel, and what the examples need

A notebook works in a folder of its own, which is deleted. Cells begin where a script has a line ``# %% TITLE``.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent

# They measure processes of their own or hand work to others, and are scripts alone.
SCRIPTS_ALONE = ("deeplens_loop", "deeplens_side_by_side", "units_with_submitit", "write_notebooks")


def names() -> list[str]:
    """The examples that have a notebook."""
    return sorted(path.stem for path in HERE.glob("*.py") if path.stem not in SCRIPTS_ALONE)


def cells(script: str) -> list[tuple[str, str]]:
    """The cells of a script, ``markdown`` or ``code`` with their text: its docstring, then a title and code for each part."""
    doc, _, body = script.removeprefix('"""').partition('"""')
    found = [("markdown", doc.strip())]
    for part in re.split(r"^# %% ", body, flags=re.M)[1:]:
        title, _, code = part.partition("\n")
        found += [("markdown", f"**{title.strip()}**"), ("code", code.strip())]
    return found


def main() -> None:
    import nbformat
    from nbclient import NotebookClient

    new = {"markdown": nbformat.v4.new_markdown_cell, "code": nbformat.v4.new_code_cell}
    for name in sys.argv[1:] or names():
        made = nbformat.v4.new_notebook(cells=[new[kind](text) for kind, text in cells((HERE / f"{name}.py").read_text(encoding="utf-8"))])
        made.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
        with tempfile.TemporaryDirectory() as folder:
            NotebookClient(made, timeout=900, resources={"metadata": {"path": folder}}).execute()
        for number, cell in enumerate(made.cells):
            # What differs from run to run without need.
            cell["id"] = f"cell-{number}"
            cell.metadata.pop("execution", None)
            if cell.cell_type == "code":
                cell.update(execution_count=None)
            for output in cell.get("outputs", []):
                if output.output_type == "execute_result":
                    output.update(execution_count=None)
        made.metadata.pop("language_info", None)
        (HERE / f"{name}.ipynb").write_text(nbformat.writes(made) + "\n", encoding="utf-8")
        print(f"{name}.ipynb")


if __name__ == "__main__":
    main()
