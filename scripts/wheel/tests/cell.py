"""A pytest plugin (`-p cell`): every test and doctest runs in a folder of its own with copies of test campaigns."""

import os
import shutil
from pathlib import Path

import pytest

BLIND = Path(__file__).resolve().parents[3] / "tests" / "data" / "blind"
CAMPAIGNS = {"cell7": "frf-9114", "cell3": "frf-9000", "drill3": "force-9439"}


@pytest.fixture(autouse=True)
def _in_a_folder_with_campaigns(tmp_path):
    for name, source in CAMPAIGNS.items():
        shutil.copytree(BLIND / source, tmp_path / name)
    before = Path.cwd()
    os.chdir(tmp_path)
    yield
    os.chdir(before)
