"""What the user states of some points is obeyed, and what cannot be meant is refused with what is nearest."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skelgen_formats.identities_csv import read_identities

import skelgen
from skelgen.app.pipeline import run_stages
from skelgen.app.project_file.archive import open_project, save_project
from skelgen.cli import main
from skelgen.errors import FormatError, InputError
from skelgen.model import Identities, Identity, PointCloud, Project, Trajectories
from skelgen.stages.labels import LabelParameters, label_markers
from skelgen.stages.labels.point_labels import find_points
from skelgen.stages.labels.user_labels.statements import ANYBODY, NOBODY, find_constraints, most_doubtful_link

METHODS = ("sets", "rigidity")


def identities_of(named):
    """Identities from (name, frame, position [mm])."""
    return Identities(tuple(Identity(name, frame, tuple(map(float, at))) for name, frame, at in named))


@pytest.fixture(scope="module")
def hidden(request):
    """A human whom five cameras see badly, its points without labels."""
    simulated = request.getfixturevalue("simulated")
    return simulated("human", seed=1, n_frames=300, labelled=False, n_cameras=5, noise=0.3, ghosts=0.2)


def frames_of(cloud):
    return np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)


def statements(simulated, random, count):
    """True statements about random points, ghosts among them."""
    cloud, marker = simulated.take, simulated.truth.marker_of_point
    names = [*simulated.truth.marker_names, "nobody"]  # the last one is index -1
    some = random.choice(cloud.n_points, count, replace=False)
    return identities_of([(names[marker[p]], int(frames_of(cloud)[p]), cloud.points[p]) for p in some])


def disobeyed(cloud, result, stated):
    """Statements that a result does not obey."""
    marker = find_points(cloud, result.positions)
    names = [*result.names, "nobody"]
    wrong = []
    for entry in stated.entries:
        away = np.linalg.norm(cloud.frame(entry.frame) - entry.position, axis=1)
        if names[marker[cloud.frame_starts[entry.frame] + int(np.argmin(away))]] != entry.name:
            wrong.append(entry)
    return wrong


@pytest.mark.parametrize("method", METHODS)
def test_true_statements_are_obeyed(hidden, method):
    stated = statements(hidden, np.random.default_rng(0), 40)
    result = label_markers(hidden.take, LabelParameters(method=method), identities=stated)[0]
    assert disobeyed(hidden.take, result, stated) == []
    assert "40 identities stated by hand are obeyed" in result.notices


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 1000))
def test_any_statements_are_obeyed_even_absurd_ones(hidden, seed):
    random, cloud = np.random.default_rng(seed), hidden.take
    some = random.choice(cloud.n_points, 12, replace=False)
    frames, names = frames_of(cloud)[some], random.permutation([*"abcdefghijk", "nobody"])
    stated = identities_of(list(zip(names.tolist(), frames.tolist(), cloud.points[some], strict=True)))
    result = label_markers(cloud, LabelParameters(method="sets"), identities=stated)[0]
    assert disobeyed(cloud, result, stated) == []


def test_no_point_is_used_twice(hidden):
    stated = statements(hidden, np.random.default_rng(1), 40)
    result = label_markers(hidden.take, LabelParameters(method="sets"), identities=stated)[0]
    assert (find_points(hidden.take, result.positions) >= 0).sum() == result.seen.sum()


def test_statements_join_what_was_not_joined(simulated):
    hard = simulated("human", seed=0, n_frames=300, labelled=False, n_cameras=4, noise=0.3)
    cloud, true = hard.take, hard.truth.marker_of_point
    plain = right_points(hard, label_markers(cloud, LabelParameters(method="sets"))[0])
    middle = [np.flatnonzero(true == m) for m in range(hard.truth.n_markers)]
    frames = frames_of(cloud)
    entries = [
        (hard.truth.marker_names[m], int(frames[p]), cloud.points[p]) for m, of in enumerate(middle) for p in of[::20]
    ]
    stated = right_points(
        hard, label_markers(cloud, LabelParameters(method="sets"), identities=identities_of(entries))[0]
    )
    assert stated > max(plain, 0.97 * cloud.n_points)


def right_points(simulated, result):
    """Points that are in the marker that most of their true marker's points are in."""
    marker, true = find_points(simulated.take, result.positions), simulated.truth.marker_of_point
    both = (marker >= 0) & (true >= 0)
    table = np.zeros((result.n_markers, simulated.truth.n_markers))
    np.add.at(table, (marker[both], true[both]), 1)
    return table.max(axis=0).sum()


class TestTracks:
    """Statements about tracks, without any labelling: one point a frame that goes straight and jumps once."""

    JUMP = 12
    POINTS = np.stack([np.arange(30.0), np.where(np.arange(30) >= JUMP, 20.0, 0.0), np.zeros(30)], axis=1)
    CLOUD = PointCloud(POINTS, np.arange(31), np.arange(30) / 100)
    ONE_TRACK = np.zeros(30, dtype=np.intp)

    def constraints(self, *entries):
        return find_constraints(self.CLOUD, self.ONE_TRACK, Identities(entries))

    def test_one_statement_names_the_whole_track(self):
        assert (self.constraints(Identity("a", 7, point=0)).name_of_point == 0).all()

    def test_a_track_with_two_names_is_cut_where_it_jumps(self):
        constraints = self.constraints(Identity("a", 2, point=0), Identity("b", 25, point=0))
        np.testing.assert_array_equal(constraints.name_of_point, np.arange(30) >= self.JUMP)
        np.testing.assert_array_equal(constraints.track_of_point, np.arange(30) >= self.JUMP)

    def test_a_cut_is_made_between_the_statements_even_if_the_jump_is_elsewhere(self):
        constraints = self.constraints(Identity("a", 20, point=0), Identity("b", 22, point=0))
        assert constraints.name_of_point[20] == 0
        assert constraints.name_of_point[22] == 1

    def test_a_last_frame_limits_what_is_said(self):
        constraints = self.constraints(Identity("a", 5, point=0, last_frame=9))
        np.testing.assert_array_equal(np.flatnonzero(constraints.name_of_point == 0), np.arange(5, 10))
        assert (np.delete(constraints.name_of_point, np.arange(5, 10)) == ANYBODY).all()

    def test_nobody_is_a_name(self):
        assert (self.constraints(Identity("nobody", 3, point=0)).name_of_point == NOBODY).all()

    def test_contradictions_are_refused(self):
        with pytest.raises(InputError, match="is a by another statement"):
            self.constraints(Identity("a", 3, point=0), Identity("b", 3, point=0))

    def test_the_worst_step_is_the_jump(self):
        assert most_doubtful_link(self.POINTS, np.arange(30), 0, 29) == self.JUMP - 1


@pytest.mark.parametrize("entries", [5, "LFHD", [("LFHD", 0)]])
def test_identities_are_made_of_statements_and_of_nothing_else(entries):
    with pytest.raises(InputError, match="made of statements"):
        Identities(entries)


def test_one_name_cannot_be_two_points_of_a_frame(hidden):
    with pytest.raises(InputError, match="another point of frame 4 has this name"):
        label_markers(
            hidden.take,
            LabelParameters(method="sets"),
            identities=Identities((Identity("a", 4, point=0), Identity("a", 4, point=1))),
        )[0]


def test_all_points_cannot_be_nobodys(hidden):
    cloud = hidden.take
    stated = Identities(
        tuple(Identity("nobody", f, point=p) for f in range(cloud.n_frames) for p in range(len(cloud.frame(f))))
    )
    with pytest.raises(InputError, match="no marker is left"):
        label_markers(cloud, LabelParameters(method="sets"), identities=stated)[0]


def test_more_names_than_markers_are_refused(hidden):
    stated = statements(hidden, np.random.default_rng(0), 40)
    with pytest.raises(InputError, match="names are stated by hand, more than the 5 markers asked for"):
        label_markers(hidden.take, LabelParameters(method="sets"), identities=stated, n_markers=5)[0]


class TestFiles:
    def read(self, folder, text):
        path = folder / "stated.csv"
        path.write_text(text)
        return read_identities(path)

    def test_positions_and_points_and_spans_are_read(self, tmp_path):
        text = "# by hand\nname,first_frame,last_frame,x,y,z,point\nLKNE,3,,1,2,3.5,\n\nnobody,4,9,,,,7\n"
        first, second = self.read(tmp_path, text).entries
        assert first == Identity("LKNE", 3, (1.0, 2.0, 3.5), line=3)
        assert second == Identity("nobody", 4, point=7, last_frame=9, line=5)

    @pytest.mark.parametrize(
        ("text", "what"),
        [
            ("name,frame\na,1", "columns name, frame and x, y, z"),
            ("name,frame,x,y,z,colour\na,1,1,1,1,red", "'colour' is unknown"),
            ("name,frame,x,y,z\na,1,1,1", "4 cells where 5 belong"),
            ("name,frame,x,y,z\na,one,1,1,1", "'one'"),
            ("name,frame,x,y,z\na,-1,1,1,1", "from 0 up"),
            ("name,frame,x,y,z\n,1,1,1,1", "empty name"),
            ("name,frame,x,y,z\na,1,1,1,inf", "finite"),
            ("name,frame,point,x,y,z\na,1,,,,", "either a position or the index"),
            ("name,frame,last_frame,point\na,9,3,1", "comes before the first"),
            ("name,frame,x,y,z\n", "no identity below"),
            ("# nothing\n", "no line but comments"),
        ],
    )
    def test_bad_lines_are_format_errors(self, tmp_path, text, what):
        with pytest.raises(FormatError, match=what):
            self.read(tmp_path, text)

    def test_a_position_without_a_point_says_what_is_nearest(self, hidden, tmp_path):
        x, y, z = hidden.take.frame(5)[3] + np.array([0.0, 0.0, 4.0])
        stated = self.read(tmp_path, f"name,frame,x,y,z\na,5,{x},{y},{z}\n")
        with pytest.raises(FormatError, match=r"stated.csv:2: a: no point .* nearest is point 3 at .* 4.0 mm away"):
            label_markers(hidden.take, LabelParameters(method="sets"), identities=stated)[0]

    @pytest.mark.parametrize(
        ("line", "what"), [("a,300,0", "last frame is 299"), ("a,5,2000", "there is no point 2000")]
    )
    def test_frames_and_points_that_do_not_exist_are_refused(self, hidden, tmp_path, line, what):
        stated = self.read(tmp_path, f"name,frame,point\n{line}\n")
        with pytest.raises(FormatError, match=what):
            label_markers(hidden.take, LabelParameters(method="sets"), identities=stated)[0]


class TestLabelled:
    """Takes that came with labels."""

    @pytest.fixture
    def take(self, request):
        return request.getfixturevalue("simulated")("rods", seed=2, n_frames=200, noise=0.2).take

    def run(self, take, *entries):
        parameters = {"labels": {"repair": False}}
        return skelgen.reconstruct(take, parameters=parameters, identities=Identities(entries)).trajectories

    def test_an_exchange_is_undone_by_one_statement(self, take):
        spoiled = take.positions.copy()
        spoiled[:, [1, 4]] = spoiled[:, [4, 1]]
        given = Trajectories(spoiled, take.names, take.rate)
        result = self.run(given, Identity(take.names[1], 80, point=4))
        np.testing.assert_array_equal(result.positions, take.positions)
        assert result.names == take.names

    def test_a_new_name_renames_the_marker(self, take):
        result = self.run(take, Identity("LKNE", 80, point=2))
        assert result.names == (*take.names[:2], "LKNE", *take.names[3:])
        np.testing.assert_array_equal(result.positions, take.positions)

    def test_nobody_leaves_the_track_out(self, take):
        result = self.run(take, Identity("nobody", 80, point=2, last_frame=100))
        assert not result.seen[80:101, 2].any()
        assert result.seen.sum() == take.seen.sum() - 21
        assert "21 positions" in result.notices[-1]

    def test_a_marker_that_is_unseen_in_the_frame_is_refused(self, take):
        positions = take.positions.copy()
        positions[80, 2] = np.nan
        with pytest.raises(InputError, match="is not seen in frame 80"):
            self.run(Trajectories(positions, take.names, take.rate), Identity("a", 80, point=2))


def test_the_command_line_takes_the_file_and_a_later_run_obeys_as_well(simulated, tmp_path):
    take = simulated("rods", seed=2, n_frames=100).take
    skelgen.write(take, tmp_path / "rods.c3d")
    (tmp_path / "stated.csv").write_text("name,frame,point\nLKNE,50,2\n")
    words = ["label", str(tmp_path / "rods.c3d"), "--identities", str(tmp_path / "stated.csv"), "-o", str(tmp_path)]
    assert main([*words, "--quiet"]) == 0
    project = open_project(tmp_path / "rods.skelgen")
    assert "LKNE" in project.trajectories.names
    assert "LKNE" in run_stages(project, "labels", "labels").trajectories.names


def test_a_project_file_keeps_what_was_stated(hidden, tmp_path):
    stated = dataclasses.replace(statements(hidden, np.random.default_rng(3), 5), source="by-hand.csv")
    path = save_project(Project(hidden.take, identities=stated), tmp_path / "take.skelgen")
    assert open_project(path).identities == stated
