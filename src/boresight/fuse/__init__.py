"""Fusing measurements before any track is asked."""
