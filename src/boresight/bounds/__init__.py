"""Lower bounds on the error of any filter or smoother."""

from boresight.bounds.cramer_rao import trajectory_bound, unconditional_bound

__all__ = ["trajectory_bound", "unconditional_bound"]
