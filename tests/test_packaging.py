"""What is distributed: wheel, source distribution, desktop entry, licences; and how the command starts."""

from __future__ import annotations

import configparser
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
from lxml import etree

from docs.generated import licence_of, licences_markdown, needed_packages

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SOURCES = ("skelgen", "formats", "gui", "tests", "docs", "examples", ".ci")
FILES = ("pyproject.toml", "MANIFEST.in", "README.md", "CHANGELOG.md", "LICENSE")
PASSING = shutil.ignore_patterns("__pycache__", "*.pyc", "reference")  # docs/reference is generated
HEAVY = [
    "numpy",
    "scipy",
    "sklearn",
    "numba",
    "lxml",
    "jinja2",
    "joblib",
    "cv2",
    "PySide6",
]


@pytest.fixture(scope="module")
def distributions(tmp_path_factory):
    """The source distribution, and the wheel that is built from it alone."""
    for tool in ("build", "twine"):
        pytest.importorskip(tool, reason=f"{tool} is not installed: pip install 'skelgen-mocap[dev]'")
    source, folder = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    for name in SOURCES:
        shutil.copytree(ROOT / name, source / name, ignore=PASSING)
    for name in FILES:
        shutil.copy(ROOT / name, source / name)
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(source)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=clean_environment())
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def clean_environment():
    """Without the paths to this checkout, which the build shall not see."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}


@pytest.fixture(scope="module")
def in_wheel(distributions):
    with zipfile.ZipFile(next(distributions.glob("*.whl"))) as wheel:
        return {name: wheel.read(name) for name in wheel.namelist()}


@pytest.fixture(scope="module")
def in_sdist(distributions):
    with tarfile.open(next(distributions.glob("*.tar.gz"))) as archive:
        return {name.partition("/")[2] for name in archive.getnames()}


def files_below(folder, pattern="*"):
    passing = {"__pycache__", "reference"}
    found = (path for path in (ROOT / folder).rglob(pattern) if path.is_file() and path.suffix != ".pyc")
    return {str(path.relative_to(ROOT)) for path in found if not passing & set(path.parts)}


def test_distributions_pass_the_check_of_the_package_index(distributions):
    files = [str(file) for file in distributions.iterdir()]
    assert len(files) == 2
    command = [sys.executable, "-m", "twine", "check", "--strict", *files]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_source_distribution_holds_all_sources_tests_and_documents(in_sdist):
    wanted = {*FILES, *(file for folder in SOURCES for file in files_below(folder))}
    assert wanted - in_sdist == set()


def test_wheel_holds_every_module_and_nothing_else_of_the_checkout(in_wheel):
    roots = {"skelgen": "", "skelgen_formats": "formats", "skelgen_gui": "gui"}
    wanted = {
        name.removeprefix(f"{root}/") for package, root in roots.items() for name in files_below(Path(root, package))
    }
    beside = {name for name in in_wheel if not re.match(r"skelgen_mocap-[^/]+\.(dist-info|data)/", name)}
    assert wanted == beside


def test_wheel_holds_the_licence_and_both_commands(in_wheel):
    [licence] = [text for name, text in in_wheel.items() if name.endswith(".dist-info/licenses/LICENSE")]
    assert licence == (ROOT / "LICENSE").read_bytes()
    [entries] = [text.decode() for name, text in in_wheel.items() if name.endswith("entry_points.txt")]
    assert "skelgen = skelgen.cli:main" in entries
    assert "skelgen-gui = skelgen_gui.main:main" in entries


def test_wheel_installs_the_desktop_entry_the_icon_and_the_kind_of_file(in_wheel):
    installed = {name.partition(".data/data/")[2] for name in in_wheel if ".data/data/" in name}
    assert installed == {
        "share/applications/skelgen.desktop",
        "share/icons/hicolor/scalable/apps/skelgen.svg",
        "share/mime/packages/skelgen-mime.xml",
    }


def test_desktop_entry_starts_the_window_with_the_installed_icon():
    entry = configparser.ConfigParser(interpolation=None)
    entry.optionxform = str
    entry.read(ROOT / "gui" / "desktop" / "skelgen.desktop", encoding="utf-8")
    told = entry["Desktop Entry"]
    assert told["Exec"].split()[0] in PROJECT["project"]["gui-scripts"]
    assert told["Icon"] == "skelgen"
    mime = etree.parse(ROOT / "gui" / "desktop" / "skelgen-mime.xml").getroot()[0]
    assert told["MimeType"] == mime.get("type") + ";"


@pytest.mark.skipif(shutil.which("desktop-file-validate") is None, reason="desktop-file-utils are not installed")
def test_desktop_entry_is_valid():
    command = ["desktop-file-validate", str(ROOT / "gui" / "desktop" / "skelgen.desktop")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "")


def test_licences_page_lists_every_dependency():
    page = (ROOT / "docs" / "licences.md").read_text(encoding="utf-8")
    extras = PROJECT["project"]["optional-dependencies"]
    wanted = [*PROJECT["project"]["dependencies"], *(text for name in set(extras) - {"dev"} for text in extras[name])]
    names = {re.match(r"[\w.-]+", text).group().lower().replace("_", "-") for text in wanted} - {"skelgen-mocap"}
    listed = {name.lower().replace("_", "-") for name in re.findall(r"^\| \[?([\w.-]+)", page, flags=re.MULTILINE)}
    assert names - listed == set(), "run python docs/generated.py"


def test_licences_page_states_what_the_installed_packages_state():
    page = (ROOT / "docs" / "licences.md").read_text(encoding="utf-8")
    table = {cells[1].strip("[] ").partition("]")[0]: cells[2].strip() for cells in rows(page)}
    fresh = {cells[1].strip("[] ").partition("]")[0]: cells[2].strip() for cells in rows(licences_markdown())}
    both = table.keys() & fresh.keys()
    assert {name: fresh[name] for name in both} == {name: table[name] for name in both}
    assert "numpy" in both


def rows(page):
    return [line.split("|") for line in page.splitlines() if line.startswith("| ") and "package" not in line]


def test_no_dependency_keeps_its_licence_to_itself():
    assert [name for name in needed_packages() if licence_of(name) == "not stated"] == []


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], []])
def test_start_of_the_command_loads_nothing_heavy(arguments):
    code = (
        "import sys, skelgen.cli\n"
        f"skelgen.cli.main({arguments})\n"
        f"print([name for name in {HEAVY} if name in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"
    assert "skelgen" in done.stdout


def test_package_runs_as_a_module():
    done = subprocess.run([sys.executable, "-m", "skelgen", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"skelgen {PROJECT['project']['version']}\n"
