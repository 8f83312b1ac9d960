#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Runs tour.py as a notebook and writes tour.ipynb beside it: make_notebook.py

Run it in the folder that holds the demo's _out_dining_room, with the package on PYTHONPATH. Needs python3-nbconvert,
python3-nbformat, python3-ipykernel and python3-matplotlib. `jupyter nbconvert --to html tour.ipynb` makes a page of it."""
import pathlib
import re

import nbformat
from nbconvert.preprocessors import ExecutePreprocessor

HERE = pathlib.Path(__file__).resolve().parent


def cells_of(text):
    for number, part in enumerate(re.split(r"^# %%", text, flags=re.M)[1:]):
        head, _, body = part.partition("\n")
        if "markdown" in head:
            cell = nbformat.v4.new_markdown_cell(re.sub(r"^# ?", "", body, flags=re.M).strip())
        else:
            cell = nbformat.v4.new_code_cell(body.strip())
        cell["id"] = f"cell-{number}"  # not drawn at random, so that the file is the same each time
        yield cell


def main():
    notebook = nbformat.v4.new_notebook(cells=list(cells_of((HERE / "tour.py").read_text())))
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    settings = nbformat.v4.new_code_cell("%matplotlib inline\n%config InlineBackend.rc = {'figure.dpi': 72}\n"
                                            "%config InlineBackend.figure_formats = ['jpeg']  # a tenth of the size")
    notebook.cells.insert(0, settings)
    ExecutePreprocessor(timeout=600, record_timing=False).preprocess(notebook, {"metadata": {"path": "."}})
    notebook.cells.pop(0)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.execution_count -= 1
            for output in cell.outputs:
                if "execution_count" in output:
                    output.execution_count -= 1
    nbformat.validate(notebook)
    nbformat.write(notebook, HERE / "tour.ipynb")
    size = (HERE / "tour.ipynb").stat().st_size
    print(f"tour.ipynb: {len(notebook.cells)} cells, {size // 1000} kB")


if __name__ == "__main__":
    main()
