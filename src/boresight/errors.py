"""The one exception that is the user's to mend."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class UserError(ValueError):
    """Bad input or usage: the message says what is wrong, where, and what to do.

    The command line prints it as one line on standard error and exits with 2.
    """


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return `" (did you mean 'x'?)"` for the known word nearest to `word`, or an empty string.

    >>> did_you_mean("sigma_azimut_deg", ["sigma_range_m", "sigma_azimuth_deg"])
    " (did you mean 'sigma_azimuth_deg'?)"
    """
    near = difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    return f" (did you mean '{near[0]}'?)" if near else ""
