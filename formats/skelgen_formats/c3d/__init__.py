"""C3D: `layout` is what a file says of itself, `reader` and `writer` its frames."""

from skelgen_formats.c3d.reader import C3D, C3D_JOINTS, read_c3d, write_c3d, write_c3d_joints

__all__ = ["C3D", "C3D_JOINTS", "read_c3d", "write_c3d", "write_c3d_joints"]
