"""What may be done to reports between the recording and the tracker: screen, smooth, align, fuse."""
