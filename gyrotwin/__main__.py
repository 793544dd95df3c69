"""`python -m gyrotwin`."""

from gyrotwin.cli import main

if __name__ == "__main__":
    main()
