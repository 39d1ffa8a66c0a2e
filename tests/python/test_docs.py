"""What docs/python.md shows runs."""

import re
import shutil

import pytest

from conftest import ROOT, SAMPLE

DOCUMENT = (ROOT / "docs/python.md").read_text()
# The line before a block says why it is not run.
BLOCKS = re.findall(r"(?:<!-- (not run: [^>]+) -->\n)?```python\n(.*?)```", DOCUMENT, re.DOTALL)


def test_the_documents_blocks_run_one_after_another(tmp_path, monkeypatch):
    folder = tmp_path / "sample"
    shutil.copytree(SAMPLE, folder)
    monkeypatch.chdir(folder)
    run = [block for why, block in BLOCKS if not why]
    assert len(run) >= 5
    names = {}
    for block in run:
        exec(compile(block, "docs/python.md", "exec"), names)


@pytest.mark.parametrize("block", [block for why, block in BLOCKS if why])
def test_what_is_not_run_can_be_read(block):
    compile(block, "docs/python.md", "exec")
