"""``python -m vtkmuscle`` is the same as ``vtkmuscle``."""

from vtkmuscle.isolation import leave_out_working_folder

if __name__ == "__main__":
    leave_out_working_folder()  # before typer and rich are loaded
    from vtkmuscle.cli import main

    main()
