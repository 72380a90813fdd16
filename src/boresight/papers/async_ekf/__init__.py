"""async_ekf: radar and infrared that report at different times, fused by an extended Kalman filter."""
