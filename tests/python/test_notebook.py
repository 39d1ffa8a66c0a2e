"""The notebook runs."""

import nbformat
from nbclient import NotebookClient

from conftest import ROOT


def test_the_notebook_runs_and_shows_a_plan():
    book = nbformat.read(ROOT / "examples/python/sweep.ipynb", as_version=4)
    NotebookClient(book, timeout=300, kernel_name="python3",
                   resources={"metadata": {"path": str(ROOT / "examples/python")}}).execute()
    shown = [output["data"] for cell in book.cells if cell.cell_type == "code"
             for output in cell.outputs if output.output_type == "execute_result"]
    assert any("text/html" in data and "<iframe" in data["text/html"] for data in shown)
    # It is kept as it is read: without what it showed.
    kept = nbformat.read(ROOT / "examples/python/sweep.ipynb", as_version=4)
    assert all(not cell.outputs for cell in kept.cells if cell.cell_type == "code")
