"""`python -m gustform_cli` is the command `gustform`."""

from gustform_cli.main import main

if __name__ == "__main__":
    main()
