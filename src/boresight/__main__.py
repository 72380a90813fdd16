"""`python -m boresight`."""

from boresight.cli import main

main()
