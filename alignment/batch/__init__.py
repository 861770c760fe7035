"""Serial parts of one design on one fixture: what their corrections have in common, and what is each part's own."""

from alignment.batch.advice import advice
from alignment.batch.batch import Batch, batch
from alignment.batch.evidence import PartEvidence, evidence_of
from alignment.batch.shapes import PartShape, Shapes, common_shape

__all__ = ["Batch", "PartEvidence", "PartShape", "Shapes", "advice", "batch", "common_shape", "evidence_of"]
