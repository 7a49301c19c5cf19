"""Stage 2: group markers into rigid limbs."""

from skelgen.stages.limbs.distances import rigid_groups
from skelgen.stages.limbs.parameters import LimbParameters
from skelgen.stages.limbs.stage import find_limbs

__all__ = ["LimbParameters", "find_limbs", "rigid_groups"]
