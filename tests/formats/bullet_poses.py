"""Run by a Python that has PyBullet, as `bullet_poses.py ROBOT MOTION RESULT.json`: where PyBullet poses links.

Of each link its mass, and in every frame its place, in metres.
"""

import csv
import json
import sys
from pathlib import Path

import pybullet

model, motion, result = sys.argv[1:4]
pybullet.connect(pybullet.DIRECT)
robot = pybullet.loadURDF(model, useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
infos = [pybullet.getJointInfo(robot, index) for index in range(pybullet.getNumJoints(robot))]
joints, links = ({info[column].decode(): info[0] for info in infos} for column in (1, 12))
header, *rows = csv.reader(Path(motion).read_text(encoding="utf-8").splitlines())
places = []
for row in rows:
    for name, value in zip(header[2:], row[2:], strict=True):
        pybullet.resetJointState(robot, joints[name.rpartition("_")[0]], float(value))
    states = {name: pybullet.getLinkState(robot, link, computeForwardKinematics=True) for name, link in links.items()}
    places.append({name: state[4] for name, state in states.items()})
masses = {name: pybullet.getDynamicsInfo(robot, link)[0] for name, link in links.items()}
Path(result).write_text(json.dumps({"masses": masses, "places": places}))
