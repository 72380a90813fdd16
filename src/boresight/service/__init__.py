"""Live: sockets, clocks and devices around the pure parts."""
