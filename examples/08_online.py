"""Labels frame by frame, as points come from a running system.

    python examples/08_online.py

First without any knowledge: the tracker learns which points move rigidly together and finds lost markers again. Then
with the skeleton of an earlier take of the same body, whose marker numbers it gives.
"""

import numpy as np

import skelgen

FAULTS = {"n_frames": 600, "noise": 0.3, "dropouts": 0.03, "ghosts": 0.2}


def main() -> None:
    live = skelgen.simulate("human", seed=11, labelled=False, **FAULTS)
    follow("nothing known", skelgen.Tracker(rate=live.take.rate), live)

    earlier = skelgen.reconstruct(skelgen.simulate("human", seed=12, n_frames=600, noise=0.3).take)
    follow("skeleton known", skelgen.Tracker(skeleton=earlier, rate=live.take.rate), live)


def follow(title: str, tracker: skelgen.Tracker, live) -> None:
    cloud, true = live.take, live.truth.marker_of_point
    found = np.empty(cloud.n_points, dtype=int)
    for frame in range(cloud.n_frames):
        span = slice(*cloud.frame_starts[frame : frame + 2])
        found[span] = tracker.update(cloud.points[span], cloud.times[frame])
    settled = np.arange(cloud.n_points) >= cloud.n_points // 2
    both = settled & (true >= 0) & (found >= 0)
    labels = len(np.unique(found[both]))
    usual = [np.bincount(found[both & (true == marker)]).max() for marker in np.unique(true[both])]
    named = 100 * both.sum() / (settled & (true >= 0)).sum()
    print(f"{title}: {labels} labels for {len(usual)} markers; {named:.1f} % of the points in the second half named,")
    print(f"  {100 * sum(usual) / both.sum():.2f} % of these by their marker's usual label")


if __name__ == "__main__":
    main()
