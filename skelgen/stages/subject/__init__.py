"""A take of a body that is known: labelled, posed and judged by a skeleton that was calibrated on another take."""

from skelgen.stages.subject.fit import KnownFit, fit_known
from skelgen.stages.subject.labels import KnownLabels, label_known

__all__ = ["KnownFit", "KnownLabels", "fit_known", "label_known"]
