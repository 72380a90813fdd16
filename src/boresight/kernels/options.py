"""Compiler settings that kernels share (those of vectorised loops are in `arctan`)."""

from __future__ import annotations

from typing import Any

# A small function that neither makes nor returns arrays, put where it is called. Without the counting of references to
# its arguments: with a tuple of arrays as an argument that costs ten times what such a function does.
LEAF: dict[str, Any] = {"cache": True, "forceinline": True, "_nrt": False}
