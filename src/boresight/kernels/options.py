"""Compiler settings that kernels share (those of vectorised loops are in `arctan`)."""

from __future__ import annotations

from typing import Any

from boresight.kernels.parts import PartCompiler

# A function that neither makes nor returns arrays. Without the counting of references to its arguments: with a tuple of
# arrays as an argument that costs ten times what a small function does.
KERNEL: dict[str, Any] = {"cache": True, "_nrt": False}
SMALL: dict[str, Any] = {**KERNEL, "forceinline": True}  # put where it is called

# The same, called by kernels only, never from Python.
BARE: dict[str, Any] = {**KERNEL, "pipeline_class": PartCompiler}
LEAF: dict[str, Any] = {**SMALL, "pipeline_class": PartCompiler}

# Parts of kernels that count references, and that make arrays (what a BARE function calls would inherit `_nrt`).
PART: dict[str, Any] = {"cache": True, "pipeline_class": PartCompiler}
COUNTED: dict[str, Any] = {**PART, "_nrt": True}
