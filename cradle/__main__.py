"""`python -m cradle`: the command line."""

from cradle.command import run

if __name__ == "__main__":
    run()
