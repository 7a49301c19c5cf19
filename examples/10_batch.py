"""Many takes in one go, some of them broken, continued after an interruption.

    python examples/10_batch.py [FOLDER]

`skelgen batch recordings -o results --jobs 4` does the same.
"""

import sys
from pathlib import Path

import skelgen

N_TAKES = 3


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
    recordings, results = folder / "recordings", folder / "results"
    for seed in range(N_TAKES):
        skelgen.write(skelgen.simulate("rods", seed=seed, n_frames=200, noise=0.3).take, recordings / f"take{seed}.c3d")
    (recordings / "broken.c3d").write_bytes((recordings / "take0.c3d").read_bytes()[:1500])

    job = skelgen.Job(formats=("bvh",))
    done = skelgen.run_batch([recordings], results, job, n_workers=2, resume=results.exists())
    show(done)
    again = skelgen.run_batch([recordings], results, job, resume=True)  # as after a kill: nothing is done twice
    show(again)
    print(f"look at {done.page}")


def show(batch) -> None:
    print(f"{batch.n_done} of {len(batch.records)} takes done, {batch.n_kept} of them before")
    for record in batch.failed:
        print(f"  {record['name']}: {record['error']}")


if __name__ == "__main__":  # worker processes load this file too
    main()
