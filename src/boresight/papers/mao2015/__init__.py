"""mao2015: a slow radar and a fast infrared sensor, fused over a window of infrared samples."""
