"""The takes of a batch, and the names of their folders."""

import pytest

from skelgen.app.batch.takes import find_entries
from skelgen.errors import InputError


@pytest.fixture
def tree(tmp_path):
    for name in ("a/walk.c3d", "b/walk.c3d", "walk.trc", "b/Walk.c3d", "notes.txt", ".hidden.c3d", "b/config.xml"):
        (tmp_path / "in" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "in" / name).write_text("something")
    return tmp_path / "in"


def test_takes_of_a_folder_keep_their_place_in_it(tree, tmp_path):
    names = [entry.name for entry in find_entries([tree], tmp_path / "out")]
    assert names == ["walk", "a/walk", "b/Walk", "b/walk-2"]


def test_patterns_keep_what_lies_below_their_steady_part(tree, tmp_path):
    names = [entry.name for entry in find_entries([f"{tree}/**/walk.c3d"], tmp_path / "out")]
    assert names == ["a/walk", "b/walk"]


def test_files_of_one_name_get_folders_of_their_own(tree, tmp_path):
    files = [tree / "a/walk.c3d", tree / "b/walk.c3d", tree / "walk.trc", tree / "a/walk.c3d"]
    entries = find_entries(files, tmp_path / "out")
    assert [entry.name for entry in entries] == ["walk", "walk-2", "walk-3"]
    assert len({entry.folder for entry in entries}) == 3


def test_a_number_never_takes_the_name_of_another_take(tree, tmp_path):
    (tree / "walk-2.c3d").write_text("something")
    files = [tree / "a/walk.c3d", tree / "b/walk.c3d", tree / "walk-2.c3d"]
    assert [entry.name for entry in find_entries(files, tmp_path / "out")] == ["walk", "walk-3", "walk-2"]


def test_known_names_stay(tree, tmp_path):
    files = [tree / "a/walk.c3d", tree / "b/walk.c3d"]
    entries = find_entries(files, tmp_path / "out", {str(files[1]): "walk"})
    assert [entry.name for entry in entries] == ["walk-2", "walk"]


def test_no_pattern_leads_out_of_the_folder(tree, tmp_path, monkeypatch):
    monkeypatch.chdir(tree)
    names = {entry.name for entry in find_entries(["*/../../in/a/walk.c3d"], tmp_path / "out")}
    assert names == {"walk"}


@pytest.mark.parametrize("missing", ["none.c3d", "none/*.c3d"])
def test_what_is_not_there_is_an_error(tmp_path, missing):
    with pytest.raises(InputError, match="none"):
        find_entries([tmp_path / missing], tmp_path / "out")
