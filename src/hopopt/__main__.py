"""`python -m hopopt`: the command line."""

from hopopt.cli import main

main()
