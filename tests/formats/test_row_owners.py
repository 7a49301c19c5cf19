"""Wide tables with a row for each person, animal or bone of a frame."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.lines import Sample
from skelgen_formats.registry import read_take

PEOPLE = "time,BodyID,knee_x,knee_y,knee_z,toe_x,toe_y,toe_z\n"


def rows(owners, frames=range(4)) -> str:
    return "".join(f"0.0{frame},{owner},{owner},2,{frame},4,5,{owner}\n" for frame in frames for owner in owners)


def test_rows_of_people_that_take_turns_are_one_frame_of_all(put):
    take = read_take(put("two.csv", PEOPLE + rows((7, 8))))
    assert (take.names, take.rate) == (("7_knee", "7_toe", "8_knee", "8_toe"), pytest.approx(100.0))
    np.testing.assert_allclose(take.positions[3, :, 2] / 1000, [3, 7, 3, 8])
    assert read_take(put("one.csv", PEOPLE + rows((7, 7)))).n_frames == 8


@pytest.mark.parametrize("title", ["person_track_id", "TrackingId", "tracking id", "bodyIdx"])
def test_who_is_tracked_may_be_told_by_other_titles(put, title):
    assert read_take(put("two.csv", PEOPLE.replace("BodyID", title) + rows((7, 8)))).n_markers == 4


def test_people_whose_rows_stand_in_blocks_are_one_frame_of_all(put):
    """Trackers of rooms write all of one person, then the next, in more rows than are looked through for titles."""
    text = PEOPLE.replace("time", "frame")
    text += "".join(f"{frame},{who},{who},2,{frame},4,5,{who}\n" for who in (7, 8) for frame in range(50))
    take = read_take(put("blocks.csv", text))
    assert (take.names, take.n_frames) == (("7_knee", "7_toe", "8_knee", "8_toe"), 50)
    assert "rows of one stand before those of the next; those of the same moment are one frame" in take.notices
    np.testing.assert_allclose(take.positions[9, :, 2] / 1000, [9, 7, 9, 8])


def test_transforms_of_ros_are_told_apart_behind_their_paths(put):
    """As a script writes the rows of /tf: two bodies in turn, seen at the same nanoseconds."""
    parts = ("translation.x", "translation.y", "translation.z", *(f"rotation.{one}" for one in "xyzw"))
    paths = ",".join(f"field.transform.{part}" for part in parts)
    text = f"%time,field.header.seq,field.header.frame_id,field.child_frame_id,{paths}\n"
    text += "".join(
        f"{1500000000000000000 + 10000000 * frame},{frame},/world,{name},{frame},{at},3,0,0,0.6,0.8\n"
        for frame in range(4)
        for at, name in enumerate(("cart", "wand"))
    )
    poses = read_take(put("tf.csv", text))
    assert (poses.names, poses.n_frames, poses.rate) == (("cart", "wand"), 4, pytest.approx(100.0))
    np.testing.assert_allclose(poses.world_from_body[3, :, :3, 3] / 1000, [[3, 0, 3], [3, 1, 3]])
    np.testing.assert_allclose(poses.world_from_body[..., 0, 0], 0.28)


def test_a_track_that_follows_another_is_no_second_person(put):
    text = PEOPLE.replace("time", "frame").replace("BodyID", "track_id")
    text += "".join(f"{frame},{7 + frame // 40},1,2,{frame},4,5,6\n" for frame in range(80))
    assert read_take(put("tracks.csv", text)).names == ("knee", "toe")


def test_names_of_coordinates_are_no_frames(put):
    """A recorder of Quest: every row has a list and the name of its coordinates, left_frame_id."""
    text = PEOPLE.replace("BodyID", "landmarks,left_frame_id")
    text += "".join(f'0.0{frame},"[0.{frame}, 1]",left_hand,1,2,{frame},4,5,6\n' for frame in range(4))
    assert read_take(put("hand.csv", text)).names == ("knee", "toe")


def test_who_has_no_row_in_a_frame_is_unseen(put):
    take = read_take(put("gap.csv", PEOPLE + rows((7, 8), range(3)) + rows((8,), [3]) + rows((7, 8), [4])))
    assert take.seen[:, 0].tolist() == [True, True, True, False, True]
    assert take.seen[:, 2].all()


def test_bones_with_two_ends_share_their_joints(put):
    """As recorders of the Leap Motion, and scripts for Blender, write them: a row for each bone."""
    bones = {"Thumb,Proximal": "1,2,3,4,5,{0}", "Thumb,Distal": "4,5,{0},7,8,9", "Index,Distal": "7,7,7,{0},8,8"}
    text = "frame_id,hand,finger_name,bone_name,start_x,start_y,start_z,end_x,end_y,end_z\n"
    text += "".join(f"{frame},left,{name},{ends.format(frame)}\n" for frame in range(5) for name, ends in bones.items())
    take = read_take(put("bones.csv", text))
    ends = ("Thumb_Proximal_start", "Thumb_Proximal_end", "Thumb_Distal_end", "Index_Distal_start", "Index_Distal_end")
    assert take.names == ends
    assert "1 point lies where another one does in every frame: left out" in take.notices


def test_bodies_may_take_turns(put):
    text = "frame,subject,hip_x,hip_y,hip_z,hip_qx,hip_qy,hip_qz,hip_qw,toe_x,toe_y,toe_z,toe_qx,toe_qy,toe_qz,toe_qw\n"
    text += "".join(
        f"{frame},{who},{frame},1,{ord(who)},0,0,0,1,3,{ord(who)},{frame},0,0,0,1\n"
        for frame in range(3)
        for who in "pq"
    )
    assert read_take(put("bodies.csv", text)).names == ("p_hip", "p_toe", "q_hip", "q_toe")


def test_frames_that_are_left_out_are_told(put):
    text = PEOPLE.replace("time", "frame") + rows((7, 8), (1, 2, 3, 6)).replace("0.0", "")
    assert any(
        "frame numbers leave some out in 1 place" in notice for notice in read_take(put("two.csv", text)).notices
    )


def test_rows_that_take_turns_are_sampled_whole(put):
    sample = Sample(most=4, above=0)
    assert read_take(put("two.csv", PEOPLE + rows((7, 8))), sample=sample).n_frames == 4
    assert sample.n_left_out == 0


def test_owners_that_hardly_recur_are_refused(refused, put):
    text = PEOPLE + rows((7, 8)) + "".join(f"{n}.5,{n},1,2,3,4,5,6\n" for n in range(9, 2000))
    assert "1993 people or points take turns" in refused(put("many.csv", text))
