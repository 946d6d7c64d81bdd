"""``python -m gcsplan`` does the same as the command ``gcsplan``; use it where scripts are not on the PATH."""

from gcsplan.cli.main import entry

if __name__ == "__main__":
    entry()
