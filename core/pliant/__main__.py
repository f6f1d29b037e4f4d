"""The entry point of `python -m pliant`, which is the `pliant` command."""

from pliant.cli.app import main

if __name__ == "__main__":
    main()
