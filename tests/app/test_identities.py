"""Identities that are stated of a project mean the markers that it has."""

from dataclasses import replace

import numpy as np
import pytest

import skelgen
from skelgen.app.corrections import with_identities
from skelgen.app.files import open_input
from skelgen.model import Identities, Identity
from skelgen.simulation import simulate


@pytest.fixture
def lost():
    """Rods without labels, the first marker of which is left out in frames 40 to 59."""
    project = skelgen.reconstruct(simulate("rods", n_frames=100, labelled=False).take, until="labels")
    positions = project.trajectories.positions.copy()
    positions[40:60, 0] = np.nan
    return replace(project, _trajectories=replace(project.trajectories, positions=positions))


def stated(path, project, frame):
    x, y, z = project.take.frame(frame)[0]
    path.write_text(f"name,frame,x,y,z\n{project.trajectories.names[0]},{frame},{x},{y},{z}\n")
    return path


def test_a_left_out_point_goes_on_with_the_marker_that_has_its_name_in_the_project(lost, tmp_path):
    """Names that the program gives come anew with the labels: a point of the marker says which one is meant."""
    (project,), file = skelgen.write(lost, tmp_path / "lost.skelgen"), stated(tmp_path / "by-hand.csv", lost, 50)
    named = open_input(project, identities=file)
    own, point = named.identities.entries
    assert (own.name, point.frame) == (lost.trajectories.names[0], 50)
    assert own.position == tuple(lost.trajectories.positions[own.frame, 0])
    assert with_identities(named, file).identities.entries == (own, point)


def test_what_a_script_states_anew_replaces_what_it_stated(lost):
    name, (first, second) = lost.trajectories.names[0], (tuple(lost.take.frame(50)[point]) for point in (0, 1))
    before = with_identities(lost, Identities((Identity(name, 5, first),)))
    assert with_identities(before, Identities((Identity(name, 5, second),))).identities.entries[-1].position == second
    assert len(with_identities(before, Identities((Identity(name, 5, second),))).identities.entries) == 1


def test_what_is_stated_where_the_marker_is_seen_is_all_that_is_stated(lost, tmp_path):
    entries = with_identities(lost, stated(tmp_path / "by-hand.csv", lost, 5)).identities.entries
    assert [one.frame for one in entries] == [5]
