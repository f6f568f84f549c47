"""`python -m pomona` is the command line."""

from pomona.cli import main

if __name__ == "__main__":
    main()
