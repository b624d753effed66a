"""`python -m hopopt`: the command line."""

from hopopt.cli.main import main

main()
