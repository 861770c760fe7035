"""Parts that sprang back: the smooth field by which a part stands out of its CAD, with its support and uncertainty."""

from alignment.non_rigid.field import Field
from alignment.non_rigid.fit import FieldFit, fit_field
from alignment.non_rigid.left import LeftOver, left_over
from alignment.non_rigid.shape import SprungSurface
from alignment.non_rigid.steps import Step

__all__ = ["Field", "FieldFit", "LeftOver", "SprungSurface", "Step", "fit_field", "left_over"]
