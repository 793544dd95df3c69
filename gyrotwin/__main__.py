"""`python -m gyrotwin`."""

from gyrotwin.cli import main

main()
