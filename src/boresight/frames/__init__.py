"""Coordinate frames, one a file: `from boresight.frames import azel, geodetic, local, …`.

geodetic (WGS84 ↔ ECEF), local (ENU and NED at a site), azel, attitude, camera, array_face, tangent (directions without
a pole), bearing (a pixel's direction and covariance), geolocate, refraction, chain (composition), pose (platforms).
"""
