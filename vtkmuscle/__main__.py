"""``python -m vtkmuscle`` is the same as ``vtkmuscle``."""

from vtkmuscle.cli import main

if __name__ == "__main__":
    main()
