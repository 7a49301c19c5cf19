"""The documentation as a site: built without a single warning, with formulas, pictures and the reference."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import skelgen

ROOT = Path(__file__).parent.parent
PAGES = sorted(path.relative_to(ROOT / "docs") for path in (ROOT / "docs").rglob("*.md"))
LIMIT = 600  # s; it takes 50 s of a core, and other tests share the machine


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built from a copy of the pages, so that nothing is written into the checkout."""
    for module in ("sphinx", "myst_parser", "numpydoc", "furo", "latex2mathml"):
        pytest.importorskip(module, reason=f"{module} is not installed: pip install 'skelgen-mocap[dev]'")
    copy = tmp_path_factory.mktemp("checkout")
    shutil.copytree(ROOT / "docs", copy / "docs", ignore=shutil.ignore_patterns("reference", "__pycache__"))
    for name in ("gui", "examples", "README.md"):
        (copy / name).symlink_to(ROOT / name)
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "docs", "site"]
    roots = os.pathsep.join(str(ROOT / folder) for folder in ("", "formats"))
    environment = os.environ | {"PYTHONPATH": roots, "PYTHONWARNINGS": ""}  # what its packages warn each other of
    done = subprocess.run(
        command, cwd=copy, env=environment, capture_output=True, text=True, timeout=LIMIT, check=False
    )
    assert done.returncode == 0, done.stderr
    return copy / "site"


def test_every_page_is_there_and_has_its_place_in_the_contents(site):
    contents = (site / "index.html").read_text(encoding="utf-8")
    for page in PAGES:
        assert (site / page).with_suffix(".html").exists()
        assert f'href="{page.with_suffix(".html").as_posix()}"' in contents or page.stem == "index"


def test_formulas_are_drawn_without_scripts(site):
    text = (site / "stages" / "joints.html").read_text(encoding="utf-8")
    assert text.count("<math ") > 3
    assert not re.search(r"<script[^>]*mathjax", text, flags=re.IGNORECASE)
    assert "$$" not in text


def test_reference_describes_the_public_face_and_every_package(site):
    text = (site / "reference" / "skelgen.html").read_text(encoding="utf-8")
    links = re.findall(r'href="([\w.]*)#(skelgen[\w.]+)"[^>]*><code[^>]*><span class="pre">skelgen\.\w+<', text)
    assert len(links) == len(skelgen.__all__)
    for page, anchor in links:
        assert f'id="{anchor}"' in (site / "reference" / (page or "skelgen.html")).read_text(encoding="utf-8")
    assert text.index("skelgen.read") < text.index("skelgen.write")


def test_pages_need_no_network(site):
    loaded = re.compile(r'(?:src|href)="https?://[^"]+\.(?:js|css|woff2?)"')
    for page in site.rglob("*.html"):
        assert not loaded.findall(page.read_text(encoding="utf-8")), page
