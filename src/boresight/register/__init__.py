"""Constant errors of sensors from targets of opportunity, off line."""
