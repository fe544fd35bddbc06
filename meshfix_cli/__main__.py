"""`python -m meshfix_cli`."""

from meshfix_cli.cli import main

main(prog_name="meshfix")
