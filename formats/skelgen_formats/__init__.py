"""File formats: one module each, and the table of all of them."""

from skelgen_formats import (
    acclaim,
    bvh,
    c3d,
    cal3d,
    classic_xml,
    csm,
    gltf,
    mfml,
    mjcf,
    motion_csv,
    motive,
    opensim,
    poses_csv,
    qualisys,
    summary_json,
    tables,
    trc,
    urdf,
    usd,
)
from skelgen_formats.registry import Format

FORMATS: tuple[Format, ...] = (
    *(c3d.C3D, trc.FORMAT, csm.FORMAT, qualisys.FORMAT, motive.FORMAT),
    *(motion_csv.JOINTS_CSV, motion_csv.ANGLES_CSV, tables.CSV, tables.PARQUET, c3d.C3D_JOINTS, poses_csv.FORMAT),
    *(classic_xml.FORMAT, cal3d.FORMAT, opensim.FORMAT, urdf.FORMAT, mjcf.FORMAT, bvh.FORMAT, acclaim.FORMAT),
    *(gltf.FORMAT, usd.FORMAT, summary_json.FORMAT, mfml.FORMAT),
)
"""All formats, in the order in which they are sniffed: the most particular content first."""

__all__ = ["FORMATS"]
