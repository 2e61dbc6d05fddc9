"""`python -m cradle`: the command line."""

from cradle.command.solve import run

if __name__ == "__main__":
    run()
