"""Make the pictures of the tutorial from its own commands: ``python docs/make_tutorial_pictures.py``.

What a frame of the recording holds, the skeleton that is found in it, and the BVH file as an importer poses it.
"""

import tempfile
from pathlib import Path

from matplotlib import pyplot
from skelgen_formats.bvh_reader import read_bvh
from skelgen_formats.registry import write_file

import skelgen
from skelgen.app.report.skeleton import small_figure
from skelgen.model import PointCloud, Project
from skelgen.simulation import simulate

FOLDER = Path(__file__).parent / "pictures"
FAULTS = {"noise": 0.5, "dropouts": 0.05, "ghosts": 0.3, "labelled": False}  # as in the tutorial
FRAME = 300
SHOWN = (0, 150, 300, 450, 600)
STEP = 900.0  # mm between the bodies of one picture
SIDE = 360.0  # px
INK, ACCENT = "#33363d", "#1f5fb4"


def main() -> None:
    """Simulate, reconstruct, draw."""
    take = simulate("human", n_frames=1000, **FAULTS).take
    project = skelgen.reconstruct(take)
    draw_points(take)
    (FOLDER / "tutorial-skeleton.svg").write_text(small_figure(project, SIDE), encoding="utf-8")
    draw_bvh(project)


def draw_points(take: PointCloud) -> None:
    """The points of one frame: nothing says which is which."""
    points = take.points[take.frame_starts[FRAME] : take.frame_starts[FRAME + 1]]
    figure, axes = pyplot.subplots(figsize=(3.6, 4.2))
    axes.scatter(points[:, 0], points[:, 2], s=14, color=INK)
    save(figure, axes, "tutorial-points")


def draw_bvh(project: Project) -> None:
    """Bones of the exported file in five frames, seen from the front (y is up in the file)."""
    with tempfile.TemporaryDirectory() as folder:
        (path,) = write_file(project, Path(folder) / "walk.bvh", axes="z-to-y")
        bones = read_bvh(path, unit="mm")
    figure, axes = pyplot.subplots(figsize=(8.4, 3.6))
    world = bones.world_from_bone
    for column, frame in enumerate(SHOWN):
        places = world[frame, :, :3, 3]
        middle = places[:, 0].mean() - STEP * column
        for bone, parent in enumerate(bones.parents):
            if parent >= 0:
                ends = places[[parent, bone]]
                axes.plot(ends[:, 0] - middle, ends[:, 1], color=ACCENT, linewidth=2.5, solid_capstyle="round")
        for bone, tips in enumerate(bones.tips):
            for tip in tips @ world[frame, bone, :3, :3].T + places[bone]:
                axes.plot(*zip(places[bone, :2] - [middle, 0], tip[:2] - [middle, 0], strict=True), color=ACCENT)
        axes.scatter(places[:, 0] - middle, places[:, 1], s=12, color=INK, zorder=3)
    save(figure, axes, "tutorial-bvh")


def save(figure: pyplot.Figure, axes: pyplot.Axes, name: str) -> None:
    """Save a picture without axes, everything to one scale."""
    axes.set_aspect("equal")
    axes.set_axis_off()
    figure.savefig(FOLDER / f"{name}.png", dpi=110, bbox_inches="tight")
    pyplot.close(figure)


if __name__ == "__main__":
    main()
