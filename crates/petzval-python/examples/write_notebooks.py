"""Makes a notebook of every example, and runs it, so that it shows its output.

    python write_notebooks.py [NAME ...]     # needs nbformat, nbclient and ipykernel, and what the examples need

A notebook works in a folder of its own, which is deleted. Cells begin where a script has a line ``# %% TITLE``.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient

HERE = Path(__file__).parent


def notebook(script: str) -> nbformat.NotebookNode:
    """The cells of a script: its docstring, then a title and code for each part."""
    doc, _, body = script.removeprefix('"""').partition('"""')
    cells = [nbformat.v4.new_markdown_cell(doc.strip())]
    for part in re.split(r"^# %% ", body, flags=re.M)[1:]:
        title, _, code = part.partition("\n")
        cells.append(nbformat.v4.new_markdown_cell(f"**{title.strip()}**"))
        cells.append(nbformat.v4.new_code_cell(code.strip()))
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number}"
    made = nbformat.v4.new_notebook(cells=cells)
    made.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return made


def main() -> None:
    names = sys.argv[1:] or sorted(path.stem for path in HERE.glob("*.py") if path != Path(__file__))
    for name in names:
        made = notebook((HERE / f"{name}.py").read_text(encoding="utf-8"))
        with tempfile.TemporaryDirectory() as folder:
            NotebookClient(made, timeout=900, resources={"metadata": {"path": folder}}).execute()
        for cell in made.cells:
            cell.metadata.pop("execution", None)
            cell.pop("execution_count", None) if cell.cell_type == "markdown" else cell.update(execution_count=None)
            for output in cell.get("outputs", []):
                output.pop("execution_count", None) if output.output_type != "execute_result" else output.update(execution_count=None)
        made.metadata.pop("language_info", None)
        (HERE / f"{name}.ipynb").write_text(nbformat.writes(made) + "\n", encoding="utf-8")
        print(f"{name}.ipynb")


if __name__ == "__main__":
    main()
