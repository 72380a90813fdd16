"""Monte Carlo studies: a scenario, a grid of its parameters, many runs, over all cores."""
