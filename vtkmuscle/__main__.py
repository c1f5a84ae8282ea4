"""``python -m vtkmuscle``, equal to the command ``vtkmuscle``."""

from vtkmuscle.cli import main

if __name__ == "__main__":
    main()
