"""XML of points: two points in three frames."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise

PLACES = [("knee", (100.5, 200, 300)), ("toe", (400, 500, 600))]
TIMES = (0.0, 0.02, 0.04)


def frames(line, point):
    points = "".join(point.format(*place, n=name) for name, place in PLACES)
    return "".join(line.format(t=t, points=points) for t in TIMES)


SENSOR = "<Sensor type='{0}'><Data>{1}</Data></Sensor>"
TEXTS = frames(
    "<Measurement timestep='{t}'>{points}</Measurement>", "<MarkerPosition name='{n}'>{0} {1} {2}</MarkerPosition>"
)
POSES = "".join(f"<Measurement timestep='{t}'><RootPosition>1 2 3</RootPosition></Measurement>" for t in TIMES)
LAYOUTS = {
    "KIT": f"<MMM><Motion><Sensors>{SENSOR.format('Pose', POSES)}{SENSOR.format('Marker', TEXTS)}</Sensors></Motion>"
    "</MMM>",
    "named elements": frames("<f t='{t}'><joints>{points}</joints></f>", "<{n} x='{0}' y='{1}' z='{2}'/>").join(
        ("<MotionCapture fps='50'>", "</MotionCapture>")
    ),
    "attributes": frames("<frame time='{t}'>{points}</frame>", "<marker name='{n}' x='{0}' y='{1}' z='{2}'/>").join(
        ("<take>", "</take>")
    ),
}


@pytest.mark.parametrize("declared", ["", "<?xml version='1.0' encoding='UTF-8'?>\n"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_points_in_elements_are_read(put, layout, declared):
    path = put("points.xml", declared + LAYOUTS[layout])
    take = read_take(path)
    assert recognise(path).name == "xml"
    assert (take.names, take.rate) == (("knee", "toe"), pytest.approx(50.0))
    np.testing.assert_allclose(take.positions, [[place for _, place in PLACES]] * 3)


def test_xml_without_points_is_told(put, refused):
    assert "XML of another program" in refused(put("plan.xml", "<?xml version='1.0'?><plan><step x='1'/></plan>"))


def test_damaged_xml_is_refused(put, refused):
    assert "broken XML" in refused(put("cut.xml", LAYOUTS["attributes"][:-30]))
