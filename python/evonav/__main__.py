"""`python -m evonav` is the `evonav` command."""

from evonav.cli import main

if __name__ == "__main__":
    main()
