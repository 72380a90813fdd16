"""boresight: from radar, infrared and optical reports to tracks and pointing commands."""

from boresight._version import __version__

__all__ = ["__version__"]
