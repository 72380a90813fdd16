"""Compiler settings that kernels share (those of vectorised loops are in `arctan`)."""

from __future__ import annotations

from typing import Any

from boresight.kernels.parts import PartCompiler

# A function that neither makes nor returns arrays. Without the counting of references to its arguments: with a tuple of
# arrays as an argument that costs ten times what a small function does.
KERNEL: dict[str, Any] = {"cache": True, "_nrt": False}
BARE: dict[str, Any] = {**KERNEL, "pipeline_class": PartCompiler}  # the same, called by kernels only
LEAF: dict[str, Any] = {**BARE, "forceinline": True}  # the same, put where it is called

# A function that makes arrays, called by one that counts no references (what it calls would inherit that).
COUNTED: dict[str, Any] = {"cache": True, "_nrt": True, "pipeline_class": PartCompiler}
