"""File formats: one module each, and the table of all of them."""

from skelgen_formats.acclaim import FORMAT as ACCLAIM
from skelgen_formats.bvh import FORMAT as BVH
from skelgen_formats.c3d import C3D, C3D_JOINTS
from skelgen_formats.cal3d import FORMAT as CAL3D
from skelgen_formats.classic_xml import FORMAT as CLASSIC_XML
from skelgen_formats.csm import FORMAT as CSM
from skelgen_formats.gltf import FORMAT as GLTF
from skelgen_formats.mfml import FORMAT as MFML
from skelgen_formats.mjcf import FORMAT as MJCF
from skelgen_formats.motion_csv import ANGLES_CSV, JOINTS_CSV
from skelgen_formats.motive import FORMAT as MOTIVE
from skelgen_formats.opensim import FORMAT as OPENSIM
from skelgen_formats.poses_csv import FORMAT as POSES_CSV
from skelgen_formats.qualisys import FORMAT as QUALISYS
from skelgen_formats.registry import Format
from skelgen_formats.summary_json import FORMAT as SUMMARY_JSON
from skelgen_formats.tables import CSV as TABLE_CSV
from skelgen_formats.tables import PARQUET as TABLE_PARQUET
from skelgen_formats.trc import FORMAT as TRC
from skelgen_formats.urdf import FORMAT as URDF
from skelgen_formats.usd import FORMAT as USD

FORMATS: tuple[Format, ...] = (
    C3D,
    TRC,
    CSM,
    QUALISYS,
    MOTIVE,
    JOINTS_CSV,
    ANGLES_CSV,
    TABLE_CSV,
    TABLE_PARQUET,
    C3D_JOINTS,
    POSES_CSV,
    CLASSIC_XML,
    CAL3D,
    OPENSIM,
    URDF,
    MJCF,
    BVH,
    ACCLAIM,
    GLTF,
    USD,
    SUMMARY_JSON,
    MFML,
)
"""All formats, in the order in which they are sniffed: the most particular content first."""

__all__ = ["FORMATS"]
