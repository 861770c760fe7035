"""The simulated scanner: a hidden truth, a robot program, and the scan file a real cell would have written.

Shares nothing with the alignment but the nouns of `planner` and `Scan`; the geometry of the true part is its own.
"""

from alignment.simulator.fields import spring_back_field
from alignment.simulator.scanner import simulate, true_shape
from alignment.simulator.truth import Noise, Truth
from alignment.simulator.write import write_readings_csv

__all__ = ["Noise", "Truth", "simulate", "spring_back_field", "true_shape", "write_readings_csv"]
