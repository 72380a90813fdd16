"""One loop for recordings and for live feeds: Source, Stage, Estimator, Sink."""
