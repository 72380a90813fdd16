"""phased_array: several guide sources steer one beam at a satellite. Scenario, the modes compared, and the table."""
